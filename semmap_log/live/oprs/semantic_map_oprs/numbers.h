/* Numbers as text and back, with a decimal point whatever the kernel's locale. */

#ifndef SEMMAP_NUMBERS_H
#define SEMMAP_NUMBERS_H

#include <stddef.h>

enum { SEMMAP_NUMBER_BYTES = 32 };

/* Write the shortest text that reads back as this number. False: it is not finite. */
int semmap_write_number(char text[SEMMAP_NUMBER_BYTES], double number);

/* Read a text that is a whole number of 64 bits, and nothing else. */
int semmap_read_integer(const char *text, long long *number);

/* Read a text that is a finite number from its first character to its last. */
int semmap_read_number(const char *text, double *number);

#endif
