/*  The doors of a log, asked from Prolog.

    A server answers: semmap-log serve LOG --ask unix:doors.sock

        ?- use_module(semmap_log), door_server('unix:doors.sock').
        ?- closed_doors(Doors).
        ?- door_state(Door, open).
        ?- door_state(3, State, "2h ago").
        ?- set_closed(3).

    A door is its id, or a text that names it: "main door", "ground/front". A time is a text as on
    the command line ("14:02", "2h ago"), event(N), or a time stamp of get_time/1. States are open,
    closed, unknown, moving and offline.

    Each thread has a connection of its own, made when it asks first. One that broke is made anew, as
    long as the time-out lasts, and what was under way is sent again: an action has an id, by which
    it is done once, also by a server that was started after a crash. Needs SWI-Prolog 9 with
    library(http/json), and nothing else.

    Apache-2.0, as the program that it comes with.
*/

:- module(semmap_log, [
       door_server/1,        % +Address
       door_server/2,        % +Address, +Options
       door_disconnect/0,
       door/1,               % ?Door
       door_state/2,         % ?Door, ?State
       door_state/3,         % ?Door, ?State, +Time
       believed_state/3,     % ?Door, ?State, +Time
       open_doors/1,         % -Doors
       closed_doors/1,       % -Doors
       p_open/2,             % ?Door, -P
       p_open/3,             % ?Door, +Time, -P
       map_p_open/2,         % ?Door, -P
       next_door/2,          % +Doors, -Door
       wait_until/3,         % +Door, +State, +Seconds
       set_open/1,           % +Door
       set_closed/1,         % +Door
       set_p_open/2,         % +Door, +P
       set_p_closed/2,       % +Door, +P
       remove_door/1,        % +Door
       refusal/1,            % -Reason
       ask_doors/3           % +Question, +Arguments, -Answer
   ]).

:- use_module(library(http/json)).
:- use_module(library(socket)).
:- use_module(library(error)).
:- use_module(library(lists)).
:- use_module(library(apply)).
:- use_module(library(option)).
:- use_module(library(random)).
:- use_module(library(readutil)).

:- dynamic server/2.                        % Address, Options
:- thread_local connection/3.               % Address, In, Out
:- thread_local refused/1.                  % Reason
:- thread_local asked/1.                    % number of the last question
:- thread_local leaves/0.                   % the thread does so at its end

%!  door_server(+Address) is det.
%!  door_server(+Address, +Options) is det.
%
%   Ask this server from now on, in all threads: 'unix:PATH' or 'tcp:HOST:PORT'. Nothing is sent
%   yet. Options:
%
%     * timeout(+Seconds)
%     How long to wait for an answer, and for a server that has gone to come back; default 10.
%     * token(+Text)
%     What the server wants to know first.

door_server(Address) :-
    door_server(Address, []).

door_server(Address, Options) :-
    must_be(list, Options),
    place(Address, _),
    option(timeout(Seconds), Options, 10),
    must_be(positive_number, Seconds),
    text_to_string(Address, Text),
    with_mutex(semmap_log, ( retractall(server(_, _)), assertz(server(Text, Options)) )),
    door_disconnect.

:- multifile error:has_type/2.

error:has_type(positive_number, X) :-
    number(X), X > 0.
error:has_type(nonneg_number, X) :-
    number(X), X >= 0.

%!  door_disconnect is det.
%
%   Leave the server; the next question connects again. Of this thread alone.

door_disconnect :-
    forall(retract(connection(_, In, Out)),
           ( close(Out, [force(true)]), close(In, [force(true)]) )).

%!  door(?Door) is nondet.
%
%   True of the doors that are in the map; ids ascending.

door(Door) :-
    var(Door),
    !,
    doors("DOORS", [], Doors),
    member(Door, Doors).
door(Door) :-
    door_word(Door, Word),
    value("DOOR_STATE", [Word], _).

%!  door_state(?Door, ?State) is nondet.
%!  door_state(?Door, ?State, +Time) is nondet.
%
%   What is true; with a time what was true then, with all that is known now. A door that is not in
%   the map has no state: it fails.

door_state(Door, State) :-
    state_of(Door, State, [], plain).

door_state(Door, State, Time) :-
    time_word(Time, Word),
    state_of(Door, State, [Word], plain).

%!  believed_state(?Door, ?State, +Time) is nondet.
%
%   What was known at that time, whatever became known later.

believed_state(Door, State, Time) :-
    time_word(Time, Word),
    state_of(Door, State, ["AT", Word], believed).

state_of(Door, State, Times, How) :-
    ( var(State) -> true ; must_be(oneof([open, closed, unknown, moving, offline]), State) ),
    (   var(Door), nonvar(State)
    ->  state_name(State, Name),
        question(How, "DOORS", [Name|Times], Asked, Words),
        doors(Asked, Words, Doors),
        member(Door, Doors)
    ;   question(How, "DOORS", Times, Asked, Words),
        among(Door, Asked, Words, Called),
        question(How, "DOOR_STATE", [Called|Times], Asked2, Words2),
        value(Asked2, Words2, Name),
        once(state_name(Found, Name)),
        State = Found
    ).

% What is asked, as it is or within BELIEVED, whose time stands behind AT.
question(plain, Name, Words, Name, Words).
question(believed, Name, Words, "BELIEVED", [Name|Words]).

state_name(open, "OPEN").
state_name(closed, "CLOSED").
state_name(unknown, "UNKNOWN").
state_name(moving, "MOVING").
state_name(offline, "OFFLINE").

%!  open_doors(-Doors) is det.
%!  closed_doors(-Doors) is det.

open_doors(Doors) :-
    doors("DOORS", ["OPEN"], Doors).

closed_doors(Doors) :-
    doors("DOORS", ["CLOSED"], Doors).

%!  p_open(?Door, -P) is nondet.
%!  p_open(?Door, +Time, -P) is nondet.
%
%   How likely it is open now, or at that time, as learnt from all that is known up to now. Fails
%   where too little was seen of it.

p_open(Door, P) :-
    p_open(Door, "now", P).

p_open(Door, Time, P) :-
    time_word(Time, Word),
    among(Door, "DOORS", [], Called),
    value("PROBABILITY_DOOR_OPEN", [Called, "AT", Word], P).

%!  map_p_open(?Door, -P) is nondet.
%
%   What somebody set for it in the map; fails where nobody did.

map_p_open(Door, P) :-
    among(Door, "DOORS", [], Called),
    value("PROBABILITY_DOOR_OPEN", [Called], P).

%!  next_door(+Doors, -Door) is semidet.
%
%   The one that is likeliest open now.

next_door(Doors, Door) :-
    must_be(list, Doors),
    Doors = [_|_],
    maplist(door_word, Doors, Words),
    value("NEXT_DOOR", Words, Found),
    door_id(Found, Door).

%!  wait_until(+Door, +State, +Seconds) is semidet.
%
%   True as soon as it is in that state; fails when the seconds are over, or at once where there is
%   no such door.

wait_until(Door, State, Seconds) :-
    door_word(Door, Word),
    must_be(oneof([open, closed, unknown, moving, offline]), State),
    must_be(nonneg_number, Seconds),
    state_name(State, Name),
    Number is float(Seconds),
    ask(_{ask: "WAIT_UNTIL", args: [Word, Name, Number]}, Seconds, Answer),
    Answer == true.

%!  set_open(+Door) is semidet.
%!  set_closed(+Door) is semidet.
%!  set_p_open(+Door, +P) is semidet.
%!  set_p_closed(+Door, +P) is semidet.
%!  remove_door(+Door) is semidet.
%
%   True once it is in the log, and lasts. Fails where it is refused: refusal/1 tells why.

set_open(Door) :-
    action("SET_DOOR_OPEN", Door, []).

set_closed(Door) :-
    action("SET_DOOR_CLOSED", Door, []).

set_p_open(Door, P) :-
    action("SET_OPEN_PROBABILITY", Door, [P]).

set_p_closed(Door, P) :-
    action("SET_CLOSED_PROBABILITY", Door, [P]).

remove_door(Door) :-
    action("REMOVE_DOOR", Door, []).

action(Name, Door, Numbers) :-
    door_word(Door, Word),
    maplist(must_be(number), Numbers),
    maplist([N, F]>>(F is float(N)), Numbers, Floats),
    Id is random(1 << 128),
    format(string(CommandId), "~`0t~16r~32|", [Id]),
    ask(_{ask: Name, args: [Word|Floats], command_id: CommandId}, 0, Answer),
    Answer == true.

%!  refusal(-Reason) is semidet.
%
%   Why the last question or action of this thread was answered by no; fails where it was not.

refusal(Reason) :-
    refused(Reason).

%!  ask_doors(+Question, +Arguments, -Answer) is det.
%
%   Any question that the server knows (HELP names them). The answer is true, false, null, a number,
%   a string, or a list of them.
%
%   @throws error(door_server_error(Message), _) where it cannot be answered.
%   @throws error(existence_error(door_server, Address), context(_, Cause)) where nobody answers there.
%   @throws error(timeout_error(answer, Address), _) where the answer does not come in time.

ask_doors(Question, Arguments, Answer) :-
    must_be(list, Arguments),
    text_to_string(Question, Name),
    maplist(any_word, Arguments, Words),
    ask(_{ask: Name, args: Words}, 0, Answer).

any_word(Number, Number) :-
    number(Number),
    !.
any_word(Text, Word) :-
    text_to_string(Text, Word).

% Doors, times.

% A door that is given, or each of those that a question names.

among(Door, Name, Words, Called) :-
    var(Door),
    !,
    doors(Name, Words, Doors),
    member(Door, Doors),
    door_word(Door, Called).
among(Door, _, _, Called) :-
    door_word(Door, Called).

doors(Name, Words, Doors) :-
    ask(_{ask: Name, args: Words}, 0, Answer),
    maplist(door_id, Answer, Doors).

value(Name, Words, Value) :-
    ask(_{ask: Name, args: Words}, 0, Value),
    Value \== null,
    Value \== false.

door_word(Door, _) :-
    var(Door),
    !,
    instantiation_error(Door).
door_word(Door, Word) :-
    integer(Door),
    !,
    must_be(nonneg, Door),
    format(string(Word), "DOOR_~d", [Door]).
door_word(Door, Word) :-
    ( atom(Door) ; string(Door) ),
    !,
    text_to_string(Door, Word).
door_word(Door, _) :-
    type_error(door, Door).

door_id(Text, Id) :-
    string_concat("DOOR_", Digits, Text),
    number_string(Id, Digits).

time_word(Time, _) :-
    var(Time),
    !,
    instantiation_error(Time).
time_word(event(Number), Word) :-
    !,
    must_be(nonneg, Number),
    format(string(Word), "event:~d", [Number]).
time_word(Time, Word) :-
    number(Time),
    !,
    Nanoseconds is round(rationalize(Time) * 1_000_000_000),
    format(string(Word), "@~d", [Nanoseconds]).
time_word(Time, Word) :-
    ( atom(Time) ; string(Time) ),
    !,
    text_to_string(Time, Word).
time_word(Time, _) :-
    type_error(time, Time).

% Lines. A question is one JSON object, which no name can end; an answer is read as data.

ask(Question, Seconds, Answer) :-
    the_server(Address, Options),
    option(timeout(Timeout), Options, 10),
    Limit is Timeout + Seconds,
    retractall(refused(_)),
    ( retract(asked(Last)) -> true ; Last = 0 ),
    Id is Last + 1,
    assertz(asked(Id)),
    with_output_to(string(Line), json_write_dict(current_output, Question.put(id, Id), [width(0)])),
    (   connection(Address, _, _)
    ->  get_time(Now),
        Deadline is Now + Timeout,
        catch(exchange(Address, Line, Limit, Reply), error(existence_error(door_server, _), _),
              once_more(Address, Options, Line, Limit, Deadline, Reply))
    ;   connect(Address, Options, Limit),
        exchange(Address, Line, Limit, Reply)
    ),
    answer_of(Reply, Id, Address, Answer).

the_server(Address, Options) :-
    (   server(Address, Options)
    ->  true
    ;   existence_error(door_server, none)
    ).

% The same line over a new connection: the server may have to be started again first.

once_more(Address, Options, Line, Limit, Deadline, Reply) :-
    catch(( connect(Address, Options, Limit), exchange(Address, Line, Limit, Reply) ),
          error(existence_error(door_server, Place), Context),
          (   get_time(Now),
              Now < Deadline
          ->  sleep(0.1),
              once_more(Address, Options, Line, Limit, Deadline, Reply)
          ;   throw(error(existence_error(door_server, Place), Context))
          )).

connect(Address, Options, Limit) :-
    door_disconnect,
    place(Address, Place),
    catch(open_socket(Place, In, Out), error(Cause, _), nobody(Address, Cause)),
    set_stream(In, encoding(utf8)),
    set_stream(In, newline(posix)),
    set_stream(Out, encoding(utf8)),
    set_stream(Out, newline(posix)),
    assertz(connection(Address, In, Out)),
    leave_with_thread,
    (   option(token(Token), Options)
    ->  text_to_string(Token, Text),
        split_string(Text, "\n\r", "", [_]),
        string_concat("TOKEN ", Text, Line),
        exchange(Address, Line, Limit, Reply),
        ( Reply == "T" -> true ; refuse(Reply) )
    ;   true
    ).

leave_with_thread :-
    (   ( thread_self(main) ; leaves )
    ->  true
    ;   assertz(leaves),
        thread_at_exit(door_disconnect)
    ).

open_socket(unix(Path), In, Out) :-
    unix_domain_socket(Socket),
    open_there(Socket, Path, In, Out).
open_socket(tcp(Host, Port), In, Out) :-
    tcp_socket(Socket),
    open_there(Socket, Host:Port, In, Out).

open_there(Socket, Place, In, Out) :-
    catch(tcp_connect(Socket, Place), Error, ( tcp_close_socket(Socket), throw(Error) )),
    tcp_open_socket(Socket, In, Out).

% The line and its answer; after a failure the connection is closed: what comes later on it would
% be the answer to another question.

exchange(Address, Line, Limit, Reply) :-
    connection(Address, In, Out),
    set_stream(In, timeout(Limit)),
    catch(( format(Out, "~s\n", [Line]), flush_output(Out), read_line_to_string(In, Got) ),
          Error, broken(Error, Address)),
    (   string(Got)
    ->  Reply = Got
    ;   broken(end, Address)
    ).

broken(Error, Address) :-
    door_disconnect,
    (   Error = error(timeout_error(_, _), _)
    ->  throw(error(timeout_error(answer, Address), _))
    ;   Error = error(Cause, _)
    ->  nobody(Address, Cause)
    ;   Error == end
    ->  nobody(Address, 'the connection ended')
    ;   throw(Error)                        % somebody interrupts us
    ).

nobody(Address, Cause) :-
    throw(error(existence_error(door_server, Address), context(_, Cause))).

answer_of(Reply, Id, Address, Answer) :-
    (   string_concat("{", _, Reply)
    ->  catch(atom_json_dict(Reply, Dict, [value_string_as_atom(false), null(null)]), error(_, _),
              broken(end, Address)),
        answer_in(Dict, Id, Address, Answer)
    ;   refuse(Reply)
    ).

answer_in(Dict, _, _, _) :-
    get_dict(error, Dict, Message),
    !,
    throw(error(door_server_error(Message), _)).
answer_in(Dict, Id, Address, Answer) :-
    (   get_dict(id, Dict, Id), get_dict(answer, Dict, Found)
    ->  true
    ;   broken(end, Address)
    ),
    ( get_dict(reason, Dict, Reason) -> assertz(refused(Reason)) ; true ),
    Answer = Found.

% What comes in words is no answer to a question in JSON, but why there is none.

refuse(Reply) :-
    door_disconnect,
    (   string_concat("ERROR ", Text, Reply),
        catch(atom_json_dict(Text, Message, []), error(_, _), fail),
        string(Message)
    ->  true
    ;   Message = Reply
    ),
    throw(error(door_server_error(Message), _)).

place(Address, Place) :-
    text_to_string(Address, Text),
    (   string_concat("unix:", Path, Text), Path \== ""
    ->  atom_string(Name, Path),
        Place = unix(Name)
    ;   string_concat("tcp:", Rest, Text),
        host_and_port(Rest, Host, Port)
    ->  Place = tcp(Host, Port)
    ;   domain_error(door_server_address, Address)
    ).

host_and_port(Text, Host, Port) :-
    sub_string(Text, Before, 1, After, ":"),
    sub_string(Text, _, After, 0, Digits),
    \+ sub_string(Digits, _, _, _, ":"),
    number_string(Port, Digits),
    integer(Port),
    sub_string(Text, 0, Before, _, Name),
    Name \== "",
    ( string_concat("[", Inner, Name), string_concat(Bare, "]", Inner) -> true ; Bare = Name ),
    atom_string(Host, Bare).

:- multifile prolog:error_message//1.

prolog:error_message(door_server_error(Message)) -->
    [ 'The door server says: ~w'-[Message] ].
prolog:error_message(existence_error(door_server, none)) -->
    [ 'No door server is named: door_server(\'unix:doors.sock\')' ].
prolog:error_message(existence_error(door_server, Address)) -->
    [ '~w: no door server answers there'-[Address] ].
prolog:error_message(timeout_error(answer, Address)) -->
    [ '~w: no answer in time; whether an action was done is not known'-[Address] ].
