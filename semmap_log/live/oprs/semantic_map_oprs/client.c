#include "client.h"

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "deadline.h"

#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0 /* there SO_NOSIGPIPE does it */
#endif

enum outcome {
    DONE,
    LOST,     /* the connection went: worth another try */
    TIMED_OUT,
    MALFORMED /* what came is no answer */
};

static const int64_t RETRY_NS = 5000000; /* where a listener's queue is full */

static void set_problem(struct semmap_client *client, const char *format, ...)
{
    va_list values;

    va_start(values, format);
    vsnprintf(client->problem, sizeof client->problem, format, values);
    va_end(values);
}

void semmap_client_init(struct semmap_client *client)
{
    memset(client, 0, sizeof *client);
    client->timeout_ms = SEMMAP_DEFAULT_TIMEOUT_MS;
    client->fd = -1;
}

void semmap_client_close(struct semmap_client *client)
{
    if (client->fd >= 0)
        close(client->fd);
    client->fd = -1;
}

int semmap_client_set(struct semmap_client *client, const char *address, const char *token_file)
{
    const char *fault = NULL;

    semmap_client_close(client);
    client->address.length = 0;
    client->problem[0] = '\0';
    if (strlen(address) >= sizeof client->address_text)
        fault = "it is too long";
    else if (token_file && strlen(token_file) >= sizeof client->token_file)
        fault = "the path of its token file is too long";
    else
        fault = semmap_read_address(&client->address, address);
    if (fault) {
        set_problem(client, "address %.80s: %s", address, fault);
        client->address.length = 0;
        return 0;
    }
    strcpy(client->address_text, address);
    strcpy(client->token_file, token_file ? token_file : "");
    return 1;
}

static int open_socket(const struct semmap_client *client)
{
    int family = client->address.socket.ss_family;
    int fd = socket(family, SOCK_STREAM, 0);
    int one = 1;

    if (fd < 0)
        return -1;
    fcntl(fd, F_SETFD, FD_CLOEXEC); /* the kernel may start ssh */
    fcntl(fd, F_SETFL, O_NONBLOCK);
#ifdef SO_NOSIGPIPE
    setsockopt(fd, SOL_SOCKET, SO_NOSIGPIPE, &one, sizeof one);
#endif
    if (family != AF_UNIX)
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    return fd;
}

/* Connect a socket until a moment; 0, or errno's number. */
static int connect_until(int fd, const struct semmap_address *address, int64_t until_ns)
{
    int error;
    socklen_t length = sizeof error;

    for (;;) {
        if (connect(fd, (const struct sockaddr *)&address->socket, address->length) == 0)
            return 0;
        if (errno != EAGAIN)
            break;
        if (semmap_now_ns() + RETRY_NS > until_ns)
            return ETIMEDOUT;
        semmap_wait(-1, 0, semmap_now_ns() + RETRY_NS);
    }
    if (errno != EINPROGRESS && errno != EINTR)
        return errno;
    if (!semmap_wait(fd, POLLOUT, until_ns))
        return ETIMEDOUT;
    return getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &length) == 0 ? error : errno;
}

/* Whether the other side is there, and says nothing of its own accord. */
static int is_alive(int fd)
{
    char byte;

    return recv(fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) < 0
        && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR);
}

static enum outcome send_all(struct semmap_client *client, const char *bytes, size_t length,
                             int64_t until_ns)
{
    while (length > 0) {
        ssize_t sent = send(client->fd, bytes, length, MSG_NOSIGNAL);

        if (sent >= 0) {
            bytes += sent;
            length -= (size_t)sent;
        } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
            if (!semmap_wait(client->fd, POLLOUT, until_ns))
                return TIMED_OUT;
        } else if (errno != EINTR) {
            return LOST;
        }
    }
    return DONE;
}

/* Check the bytes of an answer so far; DONE: they are a whole line. */
static enum outcome check(struct semmap_client *client, size_t length, int *is_whole)
{
    char *end = memchr(client->answer, '\n', length);

    *is_whole = end != NULL;
    if (end && end + 1 != client->answer + length) {
        set_problem(client, "%s: more than one line came as an answer", client->address_text);
        return MALFORMED;
    }
    if (memchr(client->answer, '\0', length)) {
        set_problem(client, "%s: the answer has a NUL in it", client->address_text);
        return MALFORMED;
    }
    if (!end && length == sizeof client->answer) {
        set_problem(client, "%s: the answer is longer than 64 KiB", client->address_text);
        return MALFORMED;
    }
    if (end)
        *end = '\0';
    return DONE;
}

static enum outcome receive_line(struct semmap_client *client, int64_t until_ns)
{
    size_t length = 0;
    int is_whole = 0;

    while (!is_whole) {
        ssize_t got = recv(client->fd, client->answer + length,
                           sizeof client->answer - length, 0);

        if (got > 0) {
            enum outcome checked;

            length += (size_t)got;
            checked = check(client, length, &is_whole);
            if (checked != DONE)
                return checked;
        } else if (got == 0) {
            return LOST;
        } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
            if (!semmap_wait(client->fd, POLLIN, until_ns))
                return TIMED_OUT;
        } else if (errno != EINTR) {
            return LOST;
        }
    }
    return DONE;
}

static enum outcome exchange(struct semmap_client *client, const char *line, size_t length,
                             int64_t until_ns)
{
    enum outcome outcome = send_all(client, line, length, until_ns);

    if (outcome == DONE)
        outcome = send_all(client, "\n", 1, until_ns);
    if (outcome == DONE)
        outcome = receive_line(client, until_ns);
    if (outcome == LOST)
        set_problem(client, "%s: the connection was lost before the answer came",
                    client->address_text);
    else if (outcome == TIMED_OUT)
        set_problem(client, "%s: no answer within %d ms", client->address_text,
                    client->timeout_ms);
    return outcome;
}

/* Read the token from its file; false: `problem` says why not. */
static int read_token(struct semmap_client *client, struct semmap_question *hello)
{
    char token[SEMMAP_PATH_BYTES];
    int fd = open(client->token_file, O_RDONLY | O_NONBLOCK);
    ssize_t length = fd < 0 ? -1 : read(fd, token, sizeof token - 1);

    if (length < 0)
        set_problem(client, "token file %.120s: %s", client->token_file, strerror(errno));
    if (fd >= 0)
        close(fd);
    if (length < 0)
        return 0;
    token[length] = '\0';
    token[strcspn(token, "\r\n")] = '\0';
    semmap_start(hello, "TOKEN");
    semmap_add_word(hello, token);
    return 1;
}

/* Show the token, where there is one. */
static int introduce(struct semmap_client *client, int64_t until_ns)
{
    static struct semmap_question hello;

    if (client->token_file[0] == '\0' || client->address.socket.ss_family == AF_UNIX)
        return 1;
    if (!read_token(client, &hello))
        return 0;
    if (exchange(client, hello.text, hello.length, until_ns) != DONE)
        return 0;
    if (strcmp(client->answer, "T") == 0)
        return 1;
    set_problem(client, "%s: refused the token of %.100s", client->address_text,
                client->token_file);
    return 0;
}

static int connected(struct semmap_client *client, int64_t until_ns)
{
    int error;

    if (client->fd >= 0 && is_alive(client->fd))
        return 1;
    semmap_client_close(client);
    if (client->address.length == 0) {
        if (client->problem[0] == '\0')
            set_problem(client, "no address: set SEMMAP_ASK before the kernel starts, "
                                "or use the action CONNECT_DOOR_MAP");
        return 0;
    }
    client->fd = open_socket(client);
    error = client->fd < 0 ? errno : connect_until(client->fd, &client->address, until_ns);
    if (error != 0)
        set_problem(client, "%s: %s", client->address_text, strerror(error));
    if (error == 0 && introduce(client, until_ns))
        return 1;
    semmap_client_close(client);
    return 0;
}

static int64_t time_out(const struct semmap_client *client)
{
    return semmap_now_ns() + (int64_t)client->timeout_ms * 1000000;
}

int semmap_client_connect(struct semmap_client *client)
{
    return connected(client, time_out(client));
}

char *semmap_client_ask(struct semmap_client *client, const struct semmap_question *question)
{
    int64_t until_ns = time_out(client);
    int attempt;

    if (question->fault) {
        set_problem(client, "not asked: %s", question->fault);
        return NULL;
    }
    for (attempt = 0; attempt < 2 && connected(client, until_ns); attempt++) {
        enum outcome outcome = exchange(client, question->text, question->length, until_ns);

        if (outcome == DONE) {
            client->problem[0] = '\0';
            return client->answer;
        }
        semmap_client_close(client); /* else a late answer would meet the next question */
        if (outcome != LOST)
            break;
    }
    return NULL;
}
