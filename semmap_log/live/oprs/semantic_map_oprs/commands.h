/* Ids of actions, so that one whose answer never came is stored once when a plan repeats it.
 *
 * An action that was answered is forgotten; one that was not keeps its id for a minute, unless
 * another action changes the same thing of the same door: then a repeat is a new wish. */

#ifndef SEMMAP_COMMANDS_H
#define SEMMAP_COMMANDS_H

enum { SEMMAP_ID_BYTES = 33 }; /* 32 hex digits and '\0' */

/* Whether a line, such as SET_DOOR_OPEN DOOR_3, is an action. */
int semmap_is_action(const char *line);

/* Get the id to send an action with: a new one, or that of the action this one repeats.
 * False: the machine gives no random numbers. */
int semmap_command_id(const char *action, char id[SEMMAP_ID_BYTES]);

/* Note that an action was answered. */
void semmap_command_answered(const char *id);

#endif
