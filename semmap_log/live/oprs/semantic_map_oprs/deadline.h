/* Waiting that ends: on the monotonic clock, whatever signals come in between. */

#ifndef SEMMAP_DEADLINE_H
#define SEMMAP_DEADLINE_H

#include <stdint.h>

/* Nanoseconds of the clock that nobody sets. */
int64_t semmap_now_ns(void);

/* Wait until a descriptor is ready (`events` as poll has them; -1: none, just wait).
 *
 * True: it is. False: the moment `until_ns` has come, or poll failed. */
int semmap_wait(int fd, short events, int64_t until_ns);

#endif
