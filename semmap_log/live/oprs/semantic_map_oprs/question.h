/* A question to the door map: words on a line. */

#ifndef SEMMAP_QUESTION_H
#define SEMMAP_QUESTION_H

#include <stddef.h>

enum { SEMMAP_LINE_BYTES = 65536 }; /* of a question or an answer, its newline among them */

struct semmap_question {
    char text[SEMMAP_LINE_BYTES]; /* ends with '\0', without the newline */
    size_t length;
    const char *fault; /* why it cannot be sent; NULL: it can */
};

/* Start a question with its first word, such as DOOR_OPEN. */
void semmap_start(struct semmap_question *question, const char *word);

/* Add a word: plain where it can be, else quoted as JSON has it. */
void semmap_add_word(struct semmap_question *question, const char *word);

/* Add a text, always quoted. */
void semmap_add_text(struct semmap_question *question, const char *text);

/* Add a number to its last digit. */
void semmap_add_number(struct semmap_question *question, double number);

/* Add a whole number. */
void semmap_add_integer(struct semmap_question *question, long long number);

#endif
