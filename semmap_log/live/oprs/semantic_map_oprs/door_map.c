#include "door_map.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client.h"
#include "commands.h"
#include "say.h"

static struct semmap_client client = {.fd = -1}; /* a module may be loaded twice */
static int was_answered = 1; /* so that a change is said, and nothing else */

static void read_timeout(void)
{
    const char *text = getenv("SEMMAP_ASK_TIMEOUT_MS");
    char *end;
    long timeout_ms;

    if (!text)
        return;
    timeout_ms = strtol(text, &end, 10);
    if (*text == '\0' || *end != '\0' || timeout_ms < 1 || timeout_ms > SEMMAP_LONGEST_TIMEOUT_MS)
        semmap_say("SEMMAP_ASK_TIMEOUT_MS is %.40s: expected 1 to %d; it stays %d", text,
                   SEMMAP_LONGEST_TIMEOUT_MS, client.timeout_ms);
    else
        client.timeout_ms = (int)timeout_ms;
}

/* Say that answers stopped or came back. */
static void tell(int is_answered)
{
    if (!is_answered)
        semmap_say("%s; the answer is NIL", client.problem);
    else if (!was_answered)
        semmap_say("%s answers again", client.address_text);
    was_answered = is_answered;
}

void semmap_door_map_start(void)
{
    const char *address = getenv("SEMMAP_ASK");

    semmap_client_close(&client);
    semmap_client_init(&client);
    read_timeout();
    if (address)
        semmap_door_map_connect(address, getenv("SEMMAP_ASK_TOKEN_FILE"));
    else
        semmap_say("SEMMAP_ASK is not set: all answers are NIL until CONNECT_DOOR_MAP");
}

int semmap_door_map_connect(const char *address, const char *token_file)
{
    if (semmap_client_set(&client, address, token_file) && semmap_client_connect(&client)) {
        semmap_say("asks %s", client.address_text);
        client.problem[0] = '\0';
        was_answered = 1;
        return 1;
    }
    tell(0);
    return 0;
}

/* Others' words are in it: it is to be as harmless in a kernel as the texts of answers are. */
static void clean(char *text)
{
    size_t at;

    for (at = 0; text[at]; at++) {
        if ((unsigned char)text[at] < 0x20 || text[at] == 0x7f
            || (text[at] == '\\' && text[at + 1] == '\0'))
            text[at] = ' ';
    }
}

void semmap_complain(const char *where, const char *what)
{
    snprintf(client.problem, sizeof client.problem, "%.100s: %.140s", where, what);
    clean(client.problem);
    semmap_say("%s; the answer is NIL", client.problem);
}

const char *semmap_problem(void)
{
    return client.problem;
}

/* Write an action behind its command id. */
static void put_id(struct semmap_question *line, const char *id, const char *action)
{
    int length = snprintf(line->text, sizeof line->text, "#%s %s", id, action);

    line->length = (size_t)length;
    line->fault = (size_t)length < sizeof line->text ? NULL : "it is longer than 64 KiB";
}

static char *act(const struct semmap_question *action)
{
    static struct semmap_question line;
    char id[SEMMAP_ID_BYTES];
    char *answer;

    if (!semmap_command_id(action->text, id)) {
        semmap_complain(action->text, "/dev/urandom gives nothing, so it would have no id");
        return NULL;
    }
    put_id(&line, id, action->text);
    answer = semmap_client_ask(&client, &line);
    if (answer)
        semmap_command_answered(id);
    return answer;
}

char *semmap_ask(const struct semmap_question *question)
{
    char *answer;

    if (question->fault) {
        semmap_complain(question->text, question->fault);
        return NULL;
    }
    answer = semmap_is_action(question->text) ? act(question)
                                              : semmap_client_ask(&client, question);
    if (answer && strncmp(answer, "ERROR", 5) == 0) {
        semmap_complain(question->text, answer);
        return NULL;
    }
    tell(answer != NULL);
    return answer;
}
