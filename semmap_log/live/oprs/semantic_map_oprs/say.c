#include "say.h"

#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { LINE_BYTES = 512 }; /* a pipe that is writable takes so much without waiting */

static const char NAME[] = "semantic_map_oprs: ";

static int can_write(int fd)
{
    struct pollfd ready = {fd, POLLOUT, 0};

    return poll(&ready, 1, 0) == 1 && (ready.revents & POLLOUT);
}

void semmap_say(const char *format, ...)
{
    static char last[LINE_BYTES];
    char line[LINE_BYTES];
    size_t length = sizeof NAME - 1;
    va_list values;

    memcpy(line, NAME, length);
    va_start(values, format);
    vsnprintf(line + length, sizeof line - length - 1, format, values);
    va_end(values);
    length = strlen(line);
    if (strcmp(line, last) == 0)
        return;
    memcpy(last, line, length + 1);
    line[length++] = '\n';
    if (can_write(STDERR_FILENO) && write(STDERR_FILENO, line, length) < 0)
        last[0] = '\0'; /* it is said when it can be */
}
