/* Messages of the module, for whoever reads the kernel's standard error. */

#ifndef SEMMAP_SAY_H
#define SEMMAP_SAY_H

#ifdef __GNUC__
#define SEMMAP_LIKE_PRINTF __attribute__((format(printf, 1, 2)))
#else
#define SEMMAP_LIKE_PRINTF
#endif

/* Write a line to standard error; the same line twice in a row is written once.
 *
 * It never waits: where standard error is a pipe that nobody reads, the line is lost. */
void semmap_say(const char *format, ...) SEMMAP_LIKE_PRINTF;

#endif
