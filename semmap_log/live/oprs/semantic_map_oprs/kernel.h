/* What of OpenPRS this module uses. Include it last: it defines names such as STRING and ATOM. */

#ifndef SEMMAP_KERNEL_H
#define SEMMAP_KERNEL_H

#include "constant-pub.h"
#include "macro-pub.h"
#include "opaque-pub.h"
#include "oprs-type-pub.h"
#include "oprs-type_f-pub.h"

#include "action_f-pub.h"
#include "ev-function_f-pub.h"
#include "ev-predicate_f-pub.h"
#include "lisp-list_f-pub.h"

/* The kernel exports these, too, but in no public header. The module is linked so that a kernel
 * without them refuses to load it. */
struct frame;
extern struct frame *const empty_env;
struct frame *make_frame(struct frame *previous);
void free_frame(struct frame *frame);
Term *find_binding_ef_or_prog_var(Term *term);
PBoolean unify_term(Term *one, Term *other, struct frame *frame);
void make_and_declare_eval_pred_no_eval_var(char *name, PBoolean (*)(struct frame *, TermList),
                                            int arity, PBoolean closed_world);

#endif
