/* A client of the door map: one question, one answer, never longer than the time-out.
 *
 * It knows nothing of OpenPRS. One thread at a time. */

#ifndef SEMMAP_CLIENT_H
#define SEMMAP_CLIENT_H

#include "address.h"
#include "question.h"

enum {
    SEMMAP_PATH_BYTES = 4096,
    SEMMAP_PROBLEM_BYTES = 256,
    SEMMAP_DEFAULT_TIMEOUT_MS = 2000,
    SEMMAP_LONGEST_TIMEOUT_MS = 600000
};

struct semmap_client {
    struct semmap_address address;
    char address_text[SEMMAP_PATH_BYTES];
    char token_file[SEMMAP_PATH_BYTES]; /* "": no token */
    int timeout_ms;                     /* of one question, connecting and asking twice included */
    int fd;                             /* -1: not connected */
    char answer[SEMMAP_LINE_BYTES];
    char problem[SEMMAP_PROBLEM_BYTES]; /* why the last question had no answer; "": it had one */
};

/* Make a client that has no address. */
void semmap_client_init(struct semmap_client *client);

/* Take an address, and a file with the token of a TCP server (NULL: none); connects later.
 * False: `problem` says what is wrong with it, and there is no address. */
int semmap_client_set(struct semmap_client *client, const char *address, const char *token_file);

/* Send a question and wait for its answer, connecting where needed.
 *
 * A connection that is lost before the answer came is made once more, and the question sent again.
 * The answer stays until the next question. NULL: there is none, `problem` says why, and whether
 * the question arrived is not known. */
char *semmap_client_ask(struct semmap_client *client, const struct semmap_question *question);

/* Connect, where it is not connected. False: `problem` says why. */
int semmap_client_connect(struct semmap_client *client);

/* Hang up. */
void semmap_client_close(struct semmap_client *client);

#endif
