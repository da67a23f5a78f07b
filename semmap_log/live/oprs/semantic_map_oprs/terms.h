/* Terms of the kernel as words of a question, and answers as terms. */

#ifndef SEMMAP_TERMS_H
#define SEMMAP_TERMS_H

#include "question.h"

#include "kernel.h"

/* Get a term of a list, 1 being the first; NULL: it has fewer. */
Term *semmap_term_at(TermList terms, int position);

/* Add the terms from this position on: atoms, texts, numbers, and those in lists. */
void semmap_add_terms(struct semmap_question *question, TermList terms, int from);

/* Build the term that an answer is; NULL: it is none. The answer's bytes are altered. */
Term *semmap_build(char *answer);

#endif
