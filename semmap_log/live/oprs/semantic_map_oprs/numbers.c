#include "numbers.h"

#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Enter the locale of C programs; what it returns is given back to `leave`. */
static locale_t enter(void)
{
    static locale_t plain;

    if (!plain)
        plain = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    return uselocale(plain);
}

static void leave(locale_t before)
{
    uselocale(before);
}

int semmap_write_number(char text[SEMMAP_NUMBER_BYTES], double number)
{
    int digits;
    locale_t before;

    if (!isfinite(number))
        return 0;
    before = enter();
    for (digits = 15; digits <= 17; digits++) {
        snprintf(text, SEMMAP_NUMBER_BYTES, "%.*g", digits, number);
        if (strtod(text, NULL) == number)
            break;
    }
    leave(before);
    return 1;
}

int semmap_read_integer(const char *text, long long *number)
{
    char *end;

    if (text[text[0] == '-'] == '\0' || text[strspn(text, "-0123456789")] != '\0')
        return 0;
    errno = 0;
    *number = strtoll(text, &end, 10);
    return *end == '\0' && errno == 0;
}

int semmap_read_number(const char *text, double *number)
{
    char *end;
    locale_t before;

    /* strtod takes more than numbers of the protocol: blanks, hexadecimals, names. */
    if (text[0] == '\0' || text[strspn(text, "+-.0123456789eE")] != '\0')
        return 0;
    before = enter();
    *number = strtod(text, &end);
    leave(before);
    return *end == '\0' && isfinite(*number);
}
