#include "answer.h"

#include <stddef.h>
#include <string.h>

#include "numbers.h"

static const struct semmap_piece BAD = {SEMMAP_BAD, NULL, 0.0, 0};

void semmap_read(struct semmap_reader *reader, char *answer)
{
    reader->next = answer;
    reader->ended = NULL;
    reader->after = '\0';
}

/* Put back what stood behind the last word. */
static void restore(struct semmap_reader *reader)
{
    if (reader->ended)
        *reader->ended = reader->after;
    reader->ended = NULL;
}

static int is_digit(unsigned char byte)
{
    return byte >= '0' && byte <= '9';
}

static int hex_digit(char digit)
{
    if (is_digit((unsigned char)digit))
        return digit - '0';
    if (digit >= 'a' && digit <= 'f')
        return digit - 'a' + 10;
    if (digit >= 'A' && digit <= 'F')
        return digit - 'A' + 10;
    return -1;
}

/* Read four hex digits; -1: they are none. */
static long code_unit(const char *digits)
{
    long unit = 0;
    int at;

    for (at = 0; at < 4; at++) {
        int value = hex_digit(digits[at]);

        if (value < 0)
            return -1;
        unit = unit * 16 + value;
    }
    return unit;
}

static char *put_utf8(char *out, long code)
{
    if (code < 0x20 || code == 0x7f) {
        *out++ = ' ';
    } else if (code < 0x80) {
        *out++ = (char)code;
    } else if (code < 0x800) {
        *out++ = (char)(0xc0 | code >> 6);
        *out++ = (char)(0x80 | (code & 0x3f));
    } else if (code < 0x10000) {
        *out++ = (char)(0xe0 | code >> 12);
        *out++ = (char)(0x80 | (code >> 6 & 0x3f));
        *out++ = (char)(0x80 | (code & 0x3f));
    } else {
        *out++ = (char)(0xf0 | code >> 18);
        *out++ = (char)(0x80 | (code >> 12 & 0x3f));
        *out++ = (char)(0x80 | (code >> 6 & 0x3f));
        *out++ = (char)(0x80 | (code & 0x3f));
    }
    return out;
}

/* Read what follows \u, a pair of surrogates too; NULL: it is malformed. */
static char *unicode(char *in, char **out)
{
    long code = code_unit(in);

    if (code < 0)
        return NULL;
    in += 4;
    if (code >= 0xd800 && code < 0xdc00 && in[0] == '\\' && in[1] == 'u') {
        long low = code_unit(in + 2);

        if (low >= 0xdc00 && low < 0xe000) {
            code = 0x10000 + (code - 0xd800) * 0x400 + (low - 0xdc00);
            in += 6;
        }
    }
    if (code >= 0xd800 && code < 0xe000)
        return NULL; /* half a pair */
    *out = put_utf8(*out, code);
    return in;
}

/* Read one escape behind its backslash; NULL: it is malformed. */
static char *escape(char *in, char **out)
{
    char letter = *in++;

    if (letter == 'u')
        return unicode(in, out);
    if (letter == '"' || letter == '\\' || letter == '/')
        *(*out)++ = letter;
    else if (letter != '\0' && strchr("bfnrt", letter))
        *(*out)++ = ' ';
    else
        return NULL;
    return in;
}

/* Read a quoted text; it is decoded where it stands, for it never grows. */
static struct semmap_piece text(struct semmap_reader *reader)
{
    struct semmap_piece piece = {SEMMAP_TEXT, NULL, 0.0, 0};
    char *in = reader->next + 1;
    char *out = in;

    piece.text = in;
    while (*in != '"') {
        if (*in == '\0')
            return BAD;
        if (*in == '\\') {
            in = escape(in + 1, &out);
            if (!in)
                return BAD;
        } else {
            unsigned char byte = (unsigned char)*in++;

            *out++ = byte < 0x20 || byte == 0x7f ? ' ' : (char)byte;
        }
    }
    if (out > piece.text && out[-1] == '\\')
        *out++ = ' '; /* there is room: it stood there as an escape */
    *out = '\0';
    reader->next = in + 1;
    return piece;
}

static int is_letter(unsigned char byte)
{
    return byte >= 0x80 || byte == '_' || (byte >= 'A' && byte <= 'Z')
        || (byte >= 'a' && byte <= 'z');
}

/* Whether it is a name such as DOOR_3; what Python calls numbers that are none is not. */
static int is_word(const char *word)
{
    if (!is_letter((unsigned char)*word) || strcmp(word, "nan") == 0 || strcmp(word, "inf") == 0)
        return 0;
    for (; *word; word++) {
        unsigned char byte = (unsigned char)*word;

        if (!is_letter(byte) && !is_digit(byte) && byte != '-' && byte != '.')
            return 0;
    }
    return 1;
}

static struct semmap_piece word(struct semmap_reader *reader)
{
    struct semmap_piece piece = {SEMMAP_WORD, reader->next, 0.0, 0};

    reader->next += strcspn(reader->next, " ()\"");
    reader->ended = reader->next;
    reader->after = *reader->next;
    *reader->ended = '\0';
    if (semmap_read_integer(piece.text, &piece.integer))
        piece.kind = SEMMAP_INTEGER;
    else if (semmap_read_number(piece.text, &piece.number))
        piece.kind = SEMMAP_NUMBER;
    else if (!is_word(piece.text))
        piece.kind = SEMMAP_BAD;
    return piece;
}

struct semmap_piece semmap_next(struct semmap_reader *reader)
{
    struct semmap_piece piece = {SEMMAP_ENDS, NULL, 0.0, 0};

    restore(reader);
    reader->next += strspn(reader->next, " ");
    switch (*reader->next) {
    case '\0':
        return piece;
    case '(':
    case ')':
        piece.kind = *reader->next++ == '(' ? SEMMAP_OPENS : SEMMAP_CLOSES;
        return piece;
    case '"':
        return text(reader);
    default:
        return word(reader);
    }
}
