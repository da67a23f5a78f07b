/* The door map as this kernel asks it: one connection, one question at a time. */

#ifndef SEMMAP_DOOR_MAP_H
#define SEMMAP_DOOR_MAP_H

#include "question.h"

/* Take the address from SEMMAP_ASK, the token file from SEMMAP_ASK_TOKEN_FILE, the time-out from
 * SEMMAP_ASK_TIMEOUT_MS, and say whether the map answers there. */
void semmap_door_map_start(void);

/* Ask at this address from now on (token file: NULL: none). False: it does not answer there. */
int semmap_door_map_connect(const char *address, const char *token_file);

/* Ask, or act: an action is answered T once it is stored.
 *
 * NULL: there is no answer; why was said, and is the problem. Whether an action was stored is then
 * not known; the same action again is sent under the same id, and so stored once. */
char *semmap_ask(const struct semmap_question *question);

/* Why the last question had no answer; "": it had one. */
const char *semmap_problem(void);

/* Say that something was no question or no answer; it becomes the problem. */
void semmap_complain(const char *where, const char *what);

#endif
