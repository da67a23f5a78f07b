/* Enough of a kernel to call what the module declares, as a program that reads lines:
 *
 *     DOOR_OPEN DOOR_1          a predicate: TRUE or FALSE
 *     WHY "main door" 0.5 7     a function or action: its value
 *     GET_OPEN_DOOR $X          a value, and what $X is bound to
 *     NEXT_DOOR ( A B )         lists, between blanks
 *     REPEAT 1000 DOOR_OPEN A   as often; the last value
 *     WHY x6162                 a text by its bytes, in hex
 *     OPEN_FILES                how many descriptors are open
 *     NAMES                     what is declared: kind, name, number of arguments
 *     QUIT
 *
 * With STUB_TICK_MS a signal comes so often, which interrupts whatever waits. Numbers look as the
 * user's locale has them.
 *
 * A value that the module does not give back or frees twice is found by the sanitizers it is built
 * with, or by valgrind. */

#include "stub_kernel.h"

#include <dirent.h>
#include <locale.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>

enum { LONGEST_LINE = 1 << 20, MOST_NAMES = 64, MOST_ITEMS = 512, MOST_ATOMS = 4096 };

struct slist {
    const void *items[MOST_ITEMS];
    int length;
};
struct l_list {
    Term *car;
    L_List cdr;
};
struct envar {
    Term *value; /* NULL: not bound */
};
struct frame {
    int unused;
};

static struct l_list nothing;
const L_List l_nil = &nothing;
static const char T_NAME[] = "T";
static const char NIL_NAME[] = "NIL";
Symbol lisp_t_sym = T_NAME;
Symbol nil_sym = NIL_NAME;
static struct frame no_bindings;
extern struct frame *const empty_env;
struct frame *const empty_env = &no_bindings;

static struct {
    const char *name;
    const char *kind;
    int arity;
    PFPT function;
    PFBPTL predicate;
    PBoolean (*with_frame)(struct frame *, TermList);
} declared[MOST_NAMES];
static int n_declared;

static void die(const char *why)
{
    fprintf(stderr, "stub kernel: %s\n", why);
    abort();
}

static void *allocate(size_t bytes)
{
    void *memory = calloc(1, bytes);

    if (!memory)
        die("no memory");
    return memory;
}

static char *copy_of(const char *text)
{
    return strcpy(allocate(strlen(text) + 1), text);
}

Symbol declare_atom(const char *name)
{
    static char *atoms[MOST_ATOMS];
    static int n_atoms;
    int at;

    if (strcmp(name, T_NAME) == 0)
        return T_NAME;
    if (strcmp(name, NIL_NAME) == 0)
        return NIL_NAME;
    for (at = 0; at < n_atoms; at++) {
        if (strcmp(atoms[at], name) == 0)
            return atoms[at];
    }
    if (n_atoms == MOST_ATOMS)
        die("too many atoms");
    return atoms[n_atoms++] = copy_of(name);
}

static Term *build(Term_Type type)
{
    Term *term = allocate(sizeof *term);

    term->type = type;
    return term;
}

Term *build_float(double number)
{
    Term *term = build(TT_FLOAT);

    term->u.doubleptr = allocate(sizeof number);
    *term->u.doubleptr = number;
    return term;
}

Term *build_integer(int number)
{
    Term *term = build(INTEGER);

    term->u.intval = number;
    return term;
}

Term *build_long_long(long long int number)
{
    Term *term = build(LONG_LONG);

    term->u.llintval = number;
    return term;
}

Term *build_string(const char *text)
{
    Term *term = build(STRING);

    term->u.string = copy_of(text);
    return term;
}

Term *build_id(Symbol name)
{
    Term *term = build(TT_ATOM);

    term->u.id = name;
    return term;
}

Term *build_nil(void)
{
    return build_id(nil_sym);
}

Term *build_t(void)
{
    return build_id(lisp_t_sym);
}

Slist *sl_make_slist(void)
{
    return allocate(sizeof(Slist));
}

int sl_slist_length(Slist *list)
{
    return list->length;
}

const void *sl_get_slist_pos(Slist *list, int position)
{
    if (position < 1 || position > list->length)
        die("there is no such term"); /* a kernel would go on with what lies there */
    return list->items[position - 1];
}

TermList build_term_list(TermList terms, Term *term)
{
    if (terms->length == MOST_ITEMS)
        die("too many terms");
    terms->items[terms->length++] = term;
    return terms;
}

Term *build_term_l_list_from_c_list(TermList terms)
{
    Term *term = build(LISP_LIST);
    int at;

    term->u.l_list = l_nil;
    for (at = terms->length - 1; at >= 0; at--) {
        L_List link = allocate(sizeof *link);

        link->car = (Term *)terms->items[at];
        link->cdr = term->u.l_list;
        term->u.l_list = link;
    }
    free(terms);
    return term;
}

Term *l_car(L_List list)
{
    return list->car;
}

L_List l_cdr(L_List list)
{
    return list->cdr;
}

Term *get_term_from_l_car(Term *car)
{
    return car;
}

void free_term(Term *term)
{
    if (term->type == TT_FLOAT)
        free(term->u.doubleptr);
    if (term->type == STRING)
        free(term->u.string);
    if (term->type == LISP_LIST) {
        while (term->u.l_list != l_nil) {
            L_List link = term->u.l_list;

            term->u.l_list = link->cdr;
            free_term(link->car);
            free(link);
        }
    }
    free(term);
}

void free_tl(TermList terms)
{
    int at;

    for (at = 0; at < terms->length; at++)
        free_term((Term *)terms->items[at]);
    free(terms);
}

struct frame *make_frame(struct frame *previous);
struct frame *make_frame(struct frame *previous)
{
    if (previous != empty_env)
        die("expected the empty frame");
    return allocate(sizeof(struct frame));
}

void free_frame(struct frame *frame);
void free_frame(struct frame *frame)
{
    free(frame);
}

Term *find_binding_ef_or_prog_var(Term *term);
Term *find_binding_ef_or_prog_var(Term *term)
{
    Term *same;

    if (term->type == STRING)
        return build_string(term->u.string);
    if (term->type == TT_FLOAT)
        return build_float(*term->u.doubleptr);
    if (term->type == LISP_LIST)
        die("a list is more than this kernel copies");
    same = build(term->type);
    same->u = term->u;
    return same;
}

PBoolean unify_term(Term *one, Term *other, struct frame *frame);
PBoolean unify_term(Term *one, Term *other, struct frame *frame)
{
    if (!frame || one->type != VARIABLE || other->type != TT_ATOM)
        die("expected a variable, an atom and a frame");
    if (one->u.var->value)
        die("it is bound already");
    one->u.var->value = build_id(other->u.id);
    return TRUE;
}

void make_and_declare_action(char *name, PFPT function, int arity)
{
    declared[n_declared].name = name;
    declared[n_declared].kind = "action";
    declared[n_declared].function = function;
    declared[n_declared++].arity = arity;
}

void make_and_declare_eval_funct(char *name, PFPT function, int arity)
{
    make_and_declare_action(name, function, arity);
    declared[n_declared - 1].kind = "function";
}

void make_and_declare_eval_pred(char *name, PFBPTL predicate, int arity, PBoolean closed_world)
{
    if (!closed_world)
        die("what is not known to be true is false");
    declared[n_declared].name = name;
    declared[n_declared].kind = "predicate";
    declared[n_declared].predicate = predicate;
    declared[n_declared++].arity = arity;
}

void make_and_declare_eval_pred_no_eval_var(char *name, PBoolean (*)(struct frame *, TermList),
                                            int arity, PBoolean closed_world);
void make_and_declare_eval_pred_no_eval_var(char *name,
                                            PBoolean (*predicate)(struct frame *, TermList),
                                            int arity, PBoolean closed_world)
{
    make_and_declare_eval_pred(name, NULL, arity, closed_world);
    declared[n_declared - 1].with_frame = predicate;
}

/* The variable of the line that is run: one is enough. */
static struct envar the_variable;

/* Put an end to the next word, and step behind it; NULL: there is none. */
static char *next_word(char **rest)
{
    char *word = *rest + strspn(*rest, " ");
    char *end;

    if (*word == '\0')
        return NULL;
    end = strchr("\"|", *word) ? strchr(word + 1, *word) + 1 : word + strcspn(word, " ");
    *rest = *end ? end + 1 : end;
    *end = '\0';
    return word;
}

static Term *read_term(char *word, char **rest);

static Term *read_list(char **rest)
{
    TermList terms = sl_make_slist();
    char *word;

    while ((word = next_word(rest)) && strcmp(word, ")") != 0)
        build_term_list(terms, read_term(word, rest));
    return build_term_l_list_from_c_list(terms);
}

static Term *read_hex(const char *digits)
{
    char *text = allocate(strlen(digits) / 2 + 1);
    size_t at;
    Term *term;

    for (at = 0; digits[at]; at += 2) {
        unsigned byte;

        sscanf(digits + at, "%2x", &byte);
        text[at / 2] = (char)byte;
    }
    term = build_string(text);
    free(text);
    return term;
}

static Term *read_term(char *word, char **rest)
{
    char *end;
    double number = strtod(word, &end);
    Term *term;

    if (strcmp(word, "(") == 0)
        return read_list(rest);
    if (word[0] == '$') {
        term = build(VARIABLE);
        term->u.var = &the_variable;
    } else if (word[0] == '"') {
        word[strlen(word) - 1] = '\0';
        term = build_string(word + 1);
    } else if (word[0] == 'x') {
        term = read_hex(word + 1);
    } else if (strcmp(word, "EXPRESSION") == 0) {
        term = build(EXPRESSION);
    } else if (*end == '\0' && word[strspn(word, "-0123456789")] == '\0') {
        term = build(LONG_LONG);
        term->u.llintval = (long long)number;
    } else if (*end == '\0') {
        term = build_float(number);
    } else {
        term = build_id(declare_atom(word));
    }
    return term;
}

static void print_term(const Term *term)
{
    L_List link;

    switch (term->type) {
    case TT_FLOAT:
        printf("%.17g", *term->u.doubleptr);
        break;
    case INTEGER:
        printf("integer %d", term->u.intval);
        break;
    case LONG_LONG:
        printf("long %lld", term->u.llintval);
        break;
    case STRING:
        printf("\"%s\"", term->u.string);
        break;
    case TT_ATOM:
        printf("%s", term->u.id);
        break;
    case LISP_LIST:
        printf("(.");
        for (link = term->u.l_list; link != l_nil; link = link->cdr) {
            printf(" ");
            print_term(link->car);
        }
        printf(" .)");
        break;
    default:
        die("a value of this type is not expected");
    }
}

static int row_of(const char *name)
{
    int row;

    for (row = 0; row < n_declared; row++) {
        if (strcmp(declared[row].name, name) == 0)
            return row;
    }
    die("nothing is declared under that name");
    return -1;
}

static void call(const char *name, TermList terms, int is_printed)
{
    static struct frame frame;
    int row = row_of(name);
    Term *value;
    PBoolean found;

    if (declared[row].arity >= 0 && declared[row].arity != terms->length)
        die("a kernel would warn of the number of arguments");
    if (declared[row].function) {
        value = declared[row].function(terms);
        if (!value)
            die("the value is NULL"); /* a kernel stops with SIGSEGV */
        if (is_printed)
            print_term(value);
        free_term(value);
        return;
    }
    found = declared[row].predicate ? declared[row].predicate(terms)
                                    : declared[row].with_frame(&frame, terms);
    if (is_printed)
        printf("%s", found ? "TRUE" : "FALSE");
}

static void print_binding(void)
{
    if (!the_variable.value)
        return;
    printf(" <- ");
    print_term(the_variable.value);
    free_term(the_variable.value);
    the_variable.value = NULL;
}

static void print_open_files(void)
{
    DIR *folder = opendir("/proc/self/fd");
    int count = -1; /* the folder's own */

    while (readdir(folder))
        count++;
    closedir(folder);
    printf("%d", count - 2); /* . and .. */
}

static void print_names(void)
{
    int row;

    for (row = 0; row < n_declared; row++)
        printf("%s %s %d;", declared[row].kind, declared[row].name, declared[row].arity);
}

static void run(char *line)
{
    char *rest = line;
    char *name = next_word(&rest);
    char *word;
    long times = 1;
    TermList terms;

    if (strcmp(name, "OPEN_FILES") == 0) {
        print_open_files();
        return;
    }
    if (strcmp(name, "NAMES") == 0) {
        print_names();
        return;
    }
    if (strcmp(name, "REPEAT") == 0) {
        times = atol(next_word(&rest));
        name = next_word(&rest);
    }
    terms = sl_make_slist();
    while ((word = next_word(&rest)))
        build_term_list(terms, read_term(word, &rest));
    while (times-- > 0)
        call(name, terms, times == 0);
    print_binding();
    free_tl(terms);
}

static void ignore(int signal_number)
{
    (void)signal_number;
}

/* Let a signal interrupt what waits, as often as the environment says. */
static void start_ticks(void)
{
    const char *tick_ms = getenv("STUB_TICK_MS");
    struct sigaction action = {.sa_handler = ignore}; /* no SA_RESTART */
    struct itimerval every = {{0, 0}, {0, 0}};

    if (!tick_ms)
        return;
    every.it_value.tv_usec = every.it_interval.tv_usec = atol(tick_ms) * 1000;
    sigaction(SIGALRM, &action, NULL);
    setitimer(ITIMER_REAL, &every, NULL);
}

void init_semantic_map_oprs(void);

int main(void)
{
    char *line = allocate(LONGEST_LINE);

    setlocale(LC_ALL, "");
    start_ticks();
    init_semantic_map_oprs();
    while (fgets(line, LONGEST_LINE, stdin)) {
        line[strcspn(line, "\n")] = '\0';
        if (strcmp(line, "QUIT") == 0)
            break;
        run(line);
        printf("\n");
        fflush(stdout);
    }
    free(line);
    return 0;
}
