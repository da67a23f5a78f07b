/* An answer of the door map: one line, read piece by piece. */

#ifndef SEMMAP_ANSWER_H
#define SEMMAP_ANSWER_H

enum semmap_kind {
    SEMMAP_WORD,   /* T, NIL, DOOR_3 */
    SEMMAP_NUMBER, /* 0.75 */
    SEMMAP_INTEGER, /* 7 */
    SEMMAP_TEXT,   /* "seen by a laser" */
    SEMMAP_OPENS,  /* ( */
    SEMMAP_CLOSES, /* ) */
    SEMMAP_ENDS,   /* there is no more */
    SEMMAP_BAD     /* this is no answer */
};

struct semmap_piece {
    enum semmap_kind kind;
    char *text; /* of a word or text: lies in the answer */
    double number;
    long long integer;
};

struct semmap_reader {
    char *next;
    char after; /* the character that a word's '\0' stands on */
    char *ended; /* where that is; NULL: nowhere */
};

/* Read an answer from its start. Its bytes are altered as it is read. */
void semmap_read(struct semmap_reader *reader, char *answer);

/* Read its next piece.
 *
 * Texts are such that a kernel can send them to another one, whoever wrote them: control characters
 * have become blanks, and behind a backslash at the end there is one. A kernel writes that as
 * "...\\" and reads the last two characters as a quote in the text: the text goes on to the next
 * quote, and what should be the next text is read as terms. */
struct semmap_piece semmap_next(struct semmap_reader *reader);

#endif
