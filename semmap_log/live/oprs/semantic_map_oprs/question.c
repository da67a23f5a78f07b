#include "question.h"

#include <stdio.h>
#include <string.h>

#include "numbers.h"

static const char TOO_LONG[] = "it is longer than 64 KiB";

static void add_bytes(struct semmap_question *question, const char *bytes, size_t length)
{
    if (length > sizeof question->text - 1 - question->length) {
        question->fault = TOO_LONG;
        return;
    }
    memcpy(question->text + question->length, bytes, length);
    question->length += length;
    question->text[question->length] = '\0';
}

static void add_blank(struct semmap_question *question)
{
    if (question->length > 0)
        add_bytes(question, " ", 1);
}

static int is_plain(const char *word)
{
    static const char PLAIN[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                "0123456789_-+.:";

    return word[0] != '\0' && word[strspn(word, PLAIN)] == '\0';
}

static void add_escaped(struct semmap_question *question, unsigned char byte)
{
    char escaped[8];

    if (byte == '"' || byte == '\\')
        snprintf(escaped, sizeof escaped, "\\%c", byte);
    else if (byte < 0x20 || byte == 0x7f)
        snprintf(escaped, sizeof escaped, "\\u%04x", byte);
    else
        snprintf(escaped, sizeof escaped, "%c", byte);
    add_bytes(question, escaped, strlen(escaped));
}

void semmap_start(struct semmap_question *question, const char *word)
{
    question->length = 0;
    question->text[0] = '\0';
    question->fault = NULL;
    semmap_add_word(question, word);
}

void semmap_add_word(struct semmap_question *question, const char *word)
{
    if (!is_plain(word)) {
        semmap_add_text(question, word);
        return;
    }
    add_blank(question);
    add_bytes(question, word, strlen(word));
}

void semmap_add_text(struct semmap_question *question, const char *text)
{
    add_blank(question);
    add_bytes(question, "\"", 1);
    for (; *text && !question->fault; text++)
        add_escaped(question, (unsigned char)*text);
    add_bytes(question, "\"", 1);
}

void semmap_add_number(struct semmap_question *question, double number)
{
    char text[SEMMAP_NUMBER_BYTES];

    if (semmap_write_number(text, number))
        semmap_add_word(question, text);
    else
        question->fault = "a number in it is not finite";
}

void semmap_add_integer(struct semmap_question *question, long long number)
{
    char text[SEMMAP_NUMBER_BYTES];

    snprintf(text, sizeof text, "%lld", number);
    semmap_add_word(question, text);
}
