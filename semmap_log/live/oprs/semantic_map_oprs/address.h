/* Where the door map answers: unix:PATH or tcp:HOST:PORT. */

#ifndef SEMMAP_ADDRESS_H
#define SEMMAP_ADDRESS_H

#include <sys/socket.h>

struct semmap_address {
    struct sockaddr_storage socket;
    socklen_t length;
};

/* Read an address. HOST is a number (127.0.0.1, [::1]) or localhost: looking up names may take
 * minutes, and nothing here may. NULL: it is good; else what is wrong with it. */
const char *semmap_read_address(struct semmap_address *address, const char *text);

#endif
