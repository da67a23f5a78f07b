#include "address.h"

#include <netdb.h>
#include <netinet/in.h>
#include <stddef.h>
#include <string.h>
#include <sys/un.h>

enum { HOST_BYTES = 64 };

static const char *read_unix(struct semmap_address *address, const char *path)
{
    struct sockaddr_un *socket = (struct sockaddr_un *)&address->socket;
    size_t length = strlen(path);

    if (length == 0)
        return "expected a path after unix:";
    if (length >= sizeof socket->sun_path)
        return "its path is longer than a Unix socket's can be; choose a shorter one";
    socket->sun_family = AF_UNIX;
    memcpy(socket->sun_path, path, length + 1);
    address->length = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length + 1);
    return NULL;
}

static const char *read_tcp(struct semmap_address *address, const char *text)
{
    static const struct addrinfo NUMERIC = {
        .ai_flags = AI_NUMERICHOST | AI_NUMERICSERV, .ai_socktype = SOCK_STREAM};
    const char *colon = strrchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : 0;
    char host[HOST_BYTES];
    struct addrinfo *found;

    if (length == 0 || colon[1] == '\0')
        return "expected tcp:HOST:PORT";
    if (text[0] == '[' && text[length - 1] == ']') {
        text++;
        length -= 2;
    }
    if (length >= sizeof host)
        return "its host is no number such as 127.0.0.1";
    memcpy(host, text, length);
    host[length] = '\0';
    if (strcmp(host, "localhost") == 0)
        strcpy(host, "127.0.0.1");
    if (getaddrinfo(host, colon + 1, &NUMERIC, &found) != 0)
        return "expected numbers, as in tcp:127.0.0.1:7000; names are not looked up";
    memcpy(&address->socket, found->ai_addr, found->ai_addrlen);
    address->length = found->ai_addrlen;
    freeaddrinfo(found);
    return NULL;
}

const char *semmap_read_address(struct semmap_address *address, const char *text)
{
    memset(address, 0, sizeof *address);
    if (strncmp(text, "unix:", 5) == 0)
        return read_unix(address, text + 5);
    if (strncmp(text, "tcp:", 4) == 0)
        return read_tcp(address, text + 4);
    return "expected unix:PATH or tcp:HOST:PORT";
}
