/* The door map in an OpenPRS kernel: predicates, functions and actions that ask `semmap-log serve`.
 *
 *     load external "DIR/semantic_map_oprs" "init_semantic_map_oprs"
 */

#include <stddef.h>
#include <string.h>

#include "door_map.h"
#include "say.h"
#include "terms.h"

#include "kernel.h"

#define ANY_NUMBER (-1) /* of arguments: a time may stand behind the usual ones */

static struct semmap_question question;

/* Ask the question; NIL where there is no answer: the kernel must never get NULL. */
static Term *ask(void)
{
    char *answer = semmap_ask(&question);
    Term *term = answer ? semmap_build(answer) : NULL;

    if (answer && !term)
        semmap_complain(question.text, "what came is no answer");
    return term ? term : build_nil();
}

static Term *ask_with(const char *word, TermList terms)
{
    semmap_start(&question, word);
    semmap_add_terms(&question, terms, 1);
    return ask();
}

static int is_atom(const Term *term, Symbol atom)
{
    return term->type == TT_ATOM && term->u.id == atom;
}

static PBoolean is_true(const char *word, TermList terms)
{
    Term *answer = ask_with(word, terms);
    PBoolean found = is_atom(answer, lisp_t_sym);

    free_term(answer);
    return found;
}

/* Unify a term with the door that is the answer. */
static PBoolean unify_with_answer(Term *term, struct frame *frame)
{
    Term *door = ask();
    PBoolean found = door->type == TT_ATOM && !is_atom(door, nil_sym)
        && unify_term(term, door, frame);

    free_term(door);
    return found;
}

/* Bind a variable to an open (closed) door; a door that is given is asked about. */
static PBoolean find_door(TermList terms, const char *which, const char *of_one,
                          struct frame *frame)
{
    Term *door = semmap_term_at(terms, 1);

    if (door && door->type == VARIABLE) {
        semmap_start(&question, which);
        semmap_add_terms(&question, terms, 2);
        return unify_with_answer(door, frame);
    }
    return is_true(of_one, terms);
}

/* The thesis's GET_OPEN_DOOR and GET_CLOSED_DOOR: functions that bind their argument. Without one,
 * or with a time alone, the door itself is the value. */
static Term *get_door(TermList terms, const char *which, const char *of_one)
{
    Term *first = semmap_term_at(terms, 1);
    struct frame *frame;
    PBoolean found;

    if (!first || first->type == STRING)
        return ask_with(which, terms);
    frame = make_frame(empty_env); /* a function gets none; what it binds stays bound */
    found = find_door(terms, which, of_one, frame);
    free_frame(frame);
    return found ? build_t() : build_nil();
}

/* ANY_OPEN_DOOR and ANY_CLOSED_DOOR: what they bind is undone where the goal fails. */
static PBoolean any_door(struct frame *frame, TermList terms, const char *which,
                         const char *of_one)
{
    TermList values = sl_make_slist();
    PBoolean found;
    int position;

    for (position = 1; position <= sl_slist_length(terms); position++) {
        Term *term = semmap_term_at(terms, position);

        values = build_term_list(values, find_binding_ef_or_prog_var(term));
    }
    found = find_door(values, which, of_one, frame);
    free_tl(values);
    return found;
}

#define PREDICATE(function, word) \
    static PBoolean function(TermList terms) { return is_true(word, terms); }
#define FUNCTION(function, word) \
    static Term *function(TermList terms) { return ask_with(word, terms); }

PREDICATE(door_state_known, "DOOR_STATE_KNOWN")
PREDICATE(door_open, "DOOR_OPEN")
PREDICATE(door_closed, "DOOR_CLOSED")

FUNCTION(probability_door_open, "PROBABILITY_DOOR_OPEN")
FUNCTION(probability_door_closed, "PROBABILITY_DOOR_CLOSED")
FUNCTION(door_state, "DOOR_STATE")
FUNCTION(believed, "BELIEVED")
FUNCTION(best_time, "BEST_TIME")
FUNCTION(next_door, "NEXT_DOOR")
FUNCTION(why, "WHY")
FUNCTION(doors, "DOORS")

FUNCTION(set_door_open, "SET_DOOR_OPEN")
FUNCTION(set_door_closed, "SET_DOOR_CLOSED")
FUNCTION(remove_door, "REMOVE_DOOR")
FUNCTION(set_open_probability, "SET_OPEN_PROBABILITY")
FUNCTION(set_closed_probability, "SET_CLOSED_PROBABILITY")

static Term *get_open_door(TermList terms)
{
    return get_door(terms, "GET_OPEN_DOOR", "DOOR_OPEN");
}

static Term *get_closed_door(TermList terms)
{
    return get_door(terms, "GET_CLOSED_DOOR", "DOOR_CLOSED");
}

static PBoolean any_open_door(struct frame *frame, TermList terms)
{
    return any_door(frame, terms, "GET_OPEN_DOOR", "DOOR_OPEN");
}

static PBoolean any_closed_door(struct frame *frame, TermList terms)
{
    return any_door(frame, terms, "GET_CLOSED_DOOR", "DOOR_CLOSED");
}

/* ASK_DOOR_MAP: any question that the server knows, word for word. */
static Term *ask_door_map(TermList terms)
{
    Term *word = semmap_term_at(terms, 1);

    if (!word || word->type != TT_ATOM) {
        semmap_complain("ASK_DOOR_MAP", "expected the question's first word, such as DOOR_OPEN");
        return build_nil();
    }
    semmap_start(&question, word->u.id);
    semmap_add_terms(&question, terms, 2);
    return ask();
}

/* DOOR_MAP_LOADED: what semantic_map.opf asks when a kernel starts. Without this module nothing is
 * declared, and a predicate that is not is merely false. */
static PBoolean door_map_loaded(TermList terms)
{
    (void)terms;
    return TRUE;
}

/* DOOR_MAP_ANSWERS: tells a door that is not open from a map that is not there. */
static PBoolean door_map_answers(TermList terms)
{
    (void)terms;
    semmap_start(&question, "DOOR_STATE_KNOWN");
    semmap_add_word(&question, "DOOR_0");
    return semmap_ask(&question) != NULL;
}

/* DOOR_MAP_PROBLEM: why the last question had no answer, or NIL. */
static Term *door_map_problem(TermList terms)
{
    (void)terms;
    return semmap_problem()[0] ? build_string(semmap_problem()) : build_nil();
}

/* CONNECT_DOOR_MAP: another address, and where it wants one, the file with its token. */
static Term *connect_door_map(TermList terms)
{
    Term *address = semmap_term_at(terms, 1);
    Term *token = semmap_term_at(terms, 2);

    if (!address || address->type != STRING || (token && token->type != STRING)) {
        semmap_complain("CONNECT_DOOR_MAP", "expected a text such as \"unix:/run/doors\"");
        return build_nil();
    }
    return semmap_door_map_connect(address->u.string, token ? token->u.string : NULL)
        ? build_t() : build_nil();
}

static const struct {
    char *name;
    PFBPTL predicate;
    int arity;
} PREDICATES[] = {
    {"DOOR_STATE_KNOWN", door_state_known, ANY_NUMBER},
    {"DOOR_OPEN", door_open, ANY_NUMBER},
    {"DOOR_CLOSED", door_closed, ANY_NUMBER},
    {"DOOR_MAP_LOADED", door_map_loaded, 0},
    {"DOOR_MAP_ANSWERS", door_map_answers, 0},
};

struct declaration {
    char *name;
    PFPT function;
    int arity;
};

static const struct declaration FUNCTIONS[] = {
    {"PROBABILITY_DOOR_OPEN", probability_door_open, ANY_NUMBER},
    {"PROBABILITY_DOOR_CLOSED", probability_door_closed, ANY_NUMBER},
    {"GET_OPEN_DOOR", get_open_door, ANY_NUMBER},
    {"GET_CLOSED_DOOR", get_closed_door, ANY_NUMBER},
    {"DOOR_STATE", door_state, ANY_NUMBER},
    {"BELIEVED", believed, ANY_NUMBER},
    {"BEST_TIME", best_time, ANY_NUMBER},
    {"NEXT_DOOR", next_door, ANY_NUMBER},
    {"WHY", why, ANY_NUMBER},
    {"DOORS", doors, ANY_NUMBER},
    {"ASK_DOOR_MAP", ask_door_map, ANY_NUMBER},
    {"DOOR_MAP_PROBLEM", door_map_problem, 0},
};

static const struct declaration ACTIONS[] = {
    {"SET_DOOR_OPEN", set_door_open, 1},
    {"SET_DOOR_CLOSED", set_door_closed, 1},
    {"REMOVE_DOOR", remove_door, 1},
    {"SET_OPEN_PROBABILITY", set_open_probability, 2},
    {"SET_CLOSED_PROBABILITY", set_closed_probability, 2},
    {"CONNECT_DOOR_MAP", connect_door_map, ANY_NUMBER},
};

#define COUNT(table) (sizeof(table) / sizeof *(table))

static void declare_all(void)
{
    size_t at;

    for (at = 0; at < COUNT(PREDICATES); at++)
        make_and_declare_eval_pred(PREDICATES[at].name, PREDICATES[at].predicate,
                                   PREDICATES[at].arity, TRUE);
    make_and_declare_eval_pred_no_eval_var("ANY_OPEN_DOOR", any_open_door, ANY_NUMBER, TRUE);
    make_and_declare_eval_pred_no_eval_var("ANY_CLOSED_DOOR", any_closed_door, ANY_NUMBER, TRUE);
    for (at = 0; at < COUNT(FUNCTIONS); at++)
        make_and_declare_eval_funct(FUNCTIONS[at].name, FUNCTIONS[at].function,
                                    FUNCTIONS[at].arity);
    for (at = 0; at < COUNT(ACTIONS); at++)
        make_and_declare_action(ACTIONS[at].name, ACTIONS[at].function, ACTIONS[at].arity);
}

/* A kernel that folds case asks for door_3, and no door is called so. */
static void check_case(void)
{
    if (strcmp(declare_atom("DOOR_aZ"), "DOOR_aZ") != 0)
        semmap_say("this kernel changes the case of names: start it with -l none");
}

#ifdef __GNUC__
__attribute__((visibility("default")))
#endif
void init_semantic_map_oprs(void);

void init_semantic_map_oprs(void)
{
    declare_all();
    check_case();
    semmap_say("loaded: %u predicates, %u functions, %u actions",
               (unsigned)COUNT(PREDICATES) + 2, (unsigned)COUNT(FUNCTIONS),
               (unsigned)COUNT(ACTIONS));
    semmap_door_map_start();
}
