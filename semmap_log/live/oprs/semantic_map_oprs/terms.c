#include "terms.h"

#include <limits.h>
#include <string.h>

#include "answer.h"

#include "kernel.h"

enum { DEEPEST = 32 };

Term *semmap_term_at(TermList terms, int position)
{
    return position <= sl_slist_length(terms) ? (Term *)sl_get_slist_pos(terms, position) : NULL;
}

/* Add an atom; the bars of |main door| are no part of its name. */
static void add_atom(struct semmap_question *question, const char *atom)
{
    size_t length = strlen(atom);
    static char name[SEMMAP_LINE_BYTES];

    if (length < 2 || length > sizeof name || atom[0] != '|' || atom[length - 1] != '|') {
        semmap_add_word(question, atom);
        return;
    }
    memcpy(name, atom + 1, length - 2);
    name[length - 2] = '\0';
    semmap_add_word(question, name);
}

static void add_term(struct semmap_question *question, Term *term, int depth);

static void add_list(struct semmap_question *question, L_List list, int depth)
{
    for (; list != l_nil && !question->fault; list = l_cdr(list))
        add_term(question, get_term_from_l_car(l_car(list)), depth + 1);
}

static void add_term(struct semmap_question *question, Term *term, int depth)
{
    switch (term->type) {
    case TT_ATOM:
        add_atom(question, term->u.id);
        break;
    case STRING:
        semmap_add_text(question, term->u.string);
        break;
    case INTEGER:
        semmap_add_integer(question, term->u.intval);
        break;
    case LONG_LONG:
        semmap_add_integer(question, term->u.llintval);
        break;
    case TT_FLOAT:
        semmap_add_number(question, *term->u.doubleptr);
        break;
    case LISP_LIST:
        if (depth < DEEPEST)
            add_list(question, term->u.l_list, depth);
        else
            question->fault = "its lists are nested too deep";
        break;
    case VARIABLE:
        question->fault = "a variable in it is not bound";
        break;
    default:
        question->fault = "an argument is no atom, text, number or list of such";
    }
}

void semmap_add_terms(struct semmap_question *question, TermList terms, int from)
{
    int position;

    for (position = from; position <= sl_slist_length(terms) && !question->fault; position++)
        add_term(question, semmap_term_at(terms, position), 0);
}

static Term *build_word(const char *word)
{
    if (strcmp(word, "NIL") == 0)
        return build_nil();
    if (strcmp(word, "T") == 0)
        return build_t();
    return build_id(declare_atom(word));
}

/* Build a whole number; the kernel's INTEGER has 32 bits, and wraps. */
static Term *build_whole(long long number)
{
    return number >= INT_MIN && number <= INT_MAX ? build_integer((int)number)
                                                  : build_long_long(number);
}

static Term *build_piece(struct semmap_reader *reader, struct semmap_piece piece, int depth);

static Term *build_list(struct semmap_reader *reader, int depth)
{
    TermList terms = sl_make_slist();
    struct semmap_piece piece = semmap_next(reader);

    while (piece.kind != SEMMAP_CLOSES) {
        Term *term = build_piece(reader, piece, depth + 1);

        if (!term) {
            free_tl(terms);
            return NULL;
        }
        terms = build_term_list(terms, term);
        piece = semmap_next(reader);
    }
    return build_term_l_list_from_c_list(terms);
}

static Term *build_piece(struct semmap_reader *reader, struct semmap_piece piece, int depth)
{
    switch (piece.kind) {
    case SEMMAP_WORD:
        return build_word(piece.text);
    case SEMMAP_NUMBER:
        return build_float(piece.number);
    case SEMMAP_INTEGER:
        return build_whole(piece.integer);
    case SEMMAP_TEXT:
        return build_string(piece.text);
    case SEMMAP_OPENS:
        return depth < DEEPEST ? build_list(reader, depth) : NULL;
    default:
        return NULL;
    }
}

Term *semmap_build(char *answer)
{
    struct semmap_reader reader;
    Term *term;

    semmap_read(&reader, answer);
    term = build_piece(&reader, semmap_next(&reader), 0);
    if (term && semmap_next(&reader).kind != SEMMAP_ENDS) {
        free_term(term);
        return NULL;
    }
    return term;
}
