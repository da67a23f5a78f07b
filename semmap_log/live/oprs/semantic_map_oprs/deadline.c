#include "deadline.h"

#include <errno.h>
#include <poll.h>
#include <time.h>

int64_t semmap_now_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

int semmap_wait(int fd, short events, int64_t until_ns)
{
    for (;;) {
        struct pollfd ready = {fd, events, 0};
        int64_t left_ns = until_ns - semmap_now_ns();
        int found;

        if (left_ns <= 0)
            return 0;
        found = poll(&ready, 1, (int)(left_ns / 1000000) + 1);
        if (found > 0)
            return 1;
        if (found < 0 && errno != EINTR)
            return 0;
        /* Interrupted or woken early: what is left is counted anew, never the whole time. */
    }
}
