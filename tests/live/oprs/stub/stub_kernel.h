/* What the module uses of an OpenPRS kernel, declared by ourselves: names and types as OpenPRS has
 * them, nothing else of it. */

#ifndef STUB_KERNEL_H
#define STUB_KERNEL_H

#define TRUE 1
#define FALSE 0

typedef char PBoolean;
typedef const char *Symbol;
typedef struct slist Slist;
typedef Slist *TermList;
typedef struct term Term;
typedef struct expression Expression;
typedef struct envar Envar;
typedef struct l_list *L_List;
typedef Term *(*PFPT)(TermList);
typedef PBoolean (*PFBPTL)(TermList);

typedef enum {
    INTEGER, LONG_LONG, TT_FLOAT, STRING, TT_ATOM, EXPRESSION, VARIABLE, LISP_LIST
} Term_Type;

struct term {
    union {
        int intval;
        long long int llintval;
        double *doubleptr;
        char *string;
        Symbol id;
        Expression *expr;
        Envar *var;
        L_List l_list;
    } u;
    Term_Type type;
};

extern const L_List l_nil;
extern Symbol lisp_t_sym;
extern Symbol nil_sym;

Slist *sl_make_slist(void);
int sl_slist_length(Slist *list);
const void *sl_get_slist_pos(Slist *list, int position);

Symbol declare_atom(const char *name);
Term *build_integer(int number);
Term *build_long_long(long long int number);
Term *build_float(double number);
Term *build_string(const char *text);
Term *build_id(Symbol name);
Term *build_nil(void);
Term *build_t(void);
TermList build_term_list(TermList terms, Term *term);
Term *build_term_l_list_from_c_list(TermList terms);
void free_term(Term *term);
void free_tl(TermList terms);

Term *l_car(L_List list);
L_List l_cdr(L_List list);
Term *get_term_from_l_car(Term *car);

void make_and_declare_action(char *name, PFPT function, int arity);
void make_and_declare_eval_funct(char *name, PFPT function, int arity);
void make_and_declare_eval_pred(char *name, PFBPTL predicate, int arity, PBoolean closed_world);

#endif
