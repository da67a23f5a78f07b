#include "commands.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

#include "deadline.h"

enum { KEPT = 64, KEPT_BYTES = 256, RANDOM_BYTES = 10 };

static const int64_t KEPT_NS = INT64_C(60000000000);

/* What an action changes: two of the same contradict each other, and REMOVED all of them. */
enum field { STATE, P_OPEN, P_CLOSED, REMOVED };

static const struct {
    const char *name;
    enum field field;
} ACTIONS[] = {
    {"SET_DOOR_OPEN", STATE},           {"SET_DOOR_CLOSED", STATE},
    {"SET_OPEN_PROBABILITY", P_OPEN},   {"SET_CLOSED_PROBABILITY", P_CLOSED},
    {"REMOVE_DOOR", REMOVED},
};
enum { N_ACTIONS = sizeof ACTIONS / sizeof *ACTIONS };

struct kept {
    char id[SEMMAP_ID_BYTES]; /* "": this place is free */
    char action[KEPT_BYTES];
    int64_t sent_ns;
};

static struct kept kept[KEPT];

/* Find the row of an action; -1: the line is none. */
static int row_of(const char *line)
{
    size_t length = strcspn(line, " ");
    int row;

    for (row = 0; row < N_ACTIONS; row++) {
        if (strlen(ACTIONS[row].name) == length && memcmp(line, ACTIONS[row].name, length) == 0)
            return row;
    }
    return -1;
}

int semmap_is_action(const char *line)
{
    return row_of(line) >= 0;
}

/* Get the door's number, as it stands in an action; 0: it has another name. */
static size_t door_number(const char *action, const char **digits)
{
    static const char PREFIX[] = " DOOR_";
    const char *door = action + strcspn(action, " ");
    size_t length;

    if (strncmp(door, PREFIX, sizeof PREFIX - 1) != 0)
        return 0;
    *digits = door + sizeof PREFIX - 1;
    length = strspn(*digits, "0123456789");
    return (*digits)[length] == ' ' || (*digits)[length] == '\0' ? length : 0;
}

/* Whether two actions may be about one door: a name may be that of any number. */
static int may_share_door(const char *one, const char *other)
{
    const char *digits, *other_digits;
    size_t length = door_number(one, &digits);
    size_t other_length = door_number(other, &other_digits);

    if (length == 0 || other_length == 0)
        return 1;
    return length == other_length && memcmp(digits, other_digits, length) == 0;
}

static int contradict(const char *one, const char *other)
{
    enum field field = ACTIONS[row_of(one)].field;
    enum field other_field = ACTIONS[row_of(other)].field;

    return may_share_door(one, other)
        && (field == other_field || field == REMOVED || other_field == REMOVED);
}

/* Fill a buffer from the machine's random numbers. */
static int fill_random(unsigned char *bytes, size_t length)
{
    int fd = open("/dev/urandom", O_RDONLY);
    ssize_t got;

    if (fd < 0)
        return 0;
    do
        got = read(fd, bytes, length);
    while (got < 0 && errno == EINTR);
    close(fd);
    return got == (ssize_t)length;
}

/* Write an id that no other process has: random digits of this one, then a count. */
static int new_id(char id[SEMMAP_ID_BYTES])
{
    static unsigned char process[RANDOM_BYTES];
    static pid_t of_process;
    static uint64_t count;
    size_t at;

    if (of_process != getpid()) {
        if (!fill_random(process, sizeof process))
            return 0;
        of_process = getpid();
    }
    for (at = 0; at < sizeof process; at++)
        snprintf(id + 2 * at, 3, "%02x", process[at]);
    snprintf(id + 2 * RANDOM_BYTES, 13, "%012llx",
             (unsigned long long)(count++ & UINT64_C(0xffffffffffff)));
    return 1;
}

/* Find the place of the same action; forget what is old, or what this one overrules. */
static struct kept *repeated(const char *action, int64_t now_ns)
{
    struct kept *found = NULL;
    size_t at;

    for (at = 0; at < KEPT; at++) {
        struct kept *other = &kept[at];

        if (other->id[0] == '\0')
            continue;
        if (now_ns - other->sent_ns > KEPT_NS)
            other->id[0] = '\0';
        else if (strcmp(other->action, action) == 0)
            found = other;
        else if (contradict(other->action, action))
            other->id[0] = '\0';
    }
    return found;
}

static struct kept *free_place(void)
{
    struct kept *oldest = &kept[0];
    size_t at;

    for (at = 0; at < KEPT; at++) {
        if (kept[at].id[0] == '\0')
            return &kept[at];
        if (kept[at].sent_ns < oldest->sent_ns)
            oldest = &kept[at];
    }
    return oldest;
}

int semmap_command_id(const char *action, char id[SEMMAP_ID_BYTES])
{
    int64_t now_ns = semmap_now_ns();
    struct kept *place = repeated(action, now_ns);

    if (place) {
        place->sent_ns = now_ns;
        memcpy(id, place->id, SEMMAP_ID_BYTES);
        return 1;
    }
    if (!new_id(id))
        return 0;
    if (strlen(action) >= KEPT_BYTES)
        return 1; /* no door has such a name: the answer is NIL however often it is sent */
    place = free_place();
    memcpy(place->id, id, SEMMAP_ID_BYTES);
    strcpy(place->action, action);
    place->sent_ns = now_ns;
    return 1;
}

void semmap_command_answered(const char *id)
{
    size_t at;

    for (at = 0; at < KEPT; at++) {
        if (strcmp(kept[at].id, id) == 0)
            kept[at].id[0] = '\0';
    }
}
