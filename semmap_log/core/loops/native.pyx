# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
# cython: initializedcheck=False, embedsignature=False, freethreading_compatible=True
"""Loops over many records, or many events, that numpy would take several passes for.

None holds the interpreter's lock, so that another thread of Python runs meanwhile. Each has the same
answer as the numpy code beside which it is used, or says that it has none; then that code is asked,
and says what is wrong. Every read is inside what was given: the bytes may come from a damaged file.

What changes in what a function takes or gives is a new `INTERFACE`, here and in `__init__.py`.
"""

from libc.stdint cimport INT64_MAX, INT64_MIN, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcpy

INTERFACE = 1

cdef enum:
    DAMAGED_ = -1
    TOO_MANY_ = -2

DAMAGED = DAMAGED_
"""`scan` found no messages that fill their chunks."""
TOO_MANY = TOO_MANY_
"""`scan` found more messages than there is room for."""

cdef enum:
    MESSAGE = 0x05
    HEAD = 31  # opcode, length, channel id, sequence, log time, publish time
    FRAME = 9  # opcode, length
    BODY_HEAD = 22  # the rest of `HEAD`
    DOOR_AT = 35  # behind the four bytes before each CDR message
    CHANNELS = 65536
    KINDS = 256


cdef struct Tables:
    const uint8_t* kind_of
    const uint32_t* bit_of
    const int64_t* length_of
    const uint8_t* is_about


cdef struct Found:
    int64_t* offset
    int64_t* place
    int64_t* number
    uint8_t* kind
    int64_t* happened
    int64_t* recorded
    uint32_t* door
    int64_t room
    int64_t messages
    int64_t events
    bint has_wrong_length


cdef struct Chunk:
    uint32_t kinds
    int64_t least
    int64_t greatest


cdef inline int64_t _scan_chunk(
    const uint8_t* data, int64_t at, int64_t end, int64_t first_event, const Tables* tables,
    Found* found, Chunk* chunk,
) noexcept nogil:
    """Walk the messages that fill at..end, all of it inside of the data; return 0, or why not."""
    cdef uint64_t length
    cdef uint16_t channel
    cdef uint32_t sequence, door
    cdef int64_t log_time, publish_time, n
    cdef uint8_t kind
    while at < end:
        if end - at < HEAD or data[at] != MESSAGE:
            return DAMAGED_
        memcpy(&length, data + at + 1, 8)
        if length < BODY_HEAD or length > <uint64_t>(end - at - FRAME):
            return DAMAGED_
        if found.messages >= found.room:
            return TOO_MANY_
        memcpy(&channel, data + at + 9, 2)
        memcpy(&log_time, data + at + 15, 8)
        chunk.kinds |= tables.bit_of[channel]
        if log_time < chunk.least:
            chunk.least = log_time
        if log_time > chunk.greatest:
            chunk.greatest = log_time
        kind = tables.kind_of[channel]
        if kind:
            if tables.length_of[kind] >= 0 and <uint64_t>tables.length_of[kind] != length:
                found.has_wrong_length = True
            memcpy(&sequence, data + at + 11, 4)
            memcpy(&publish_time, data + at + 23, 8)
            door = 0
            if tables.is_about[kind] and length >= BODY_HEAD + 8:
                memcpy(&door, data + at + DOOR_AT, 4)
            n = found.events
            found.place[n] = found.messages
            found.number[n] = first_event + <int64_t>(<uint32_t>(sequence - <uint32_t>first_event))
            found.kind[n] = kind
            found.happened[n] = publish_time
            found.recorded[n] = log_time
            found.door[n] = door
            found.events = n + 1
        found.offset[found.messages] = at
        found.messages += 1
        at += FRAME + <int64_t>length
    return 0


def scan(
    const uint8_t[::1] records,
    const int64_t[::1] starts,
    const int64_t[::1] ends,
    int64_t first_event,
    const uint8_t[::1] kind_of,
    const uint32_t[::1] bit_of,
    const int64_t[::1] length_of,
    const uint8_t[::1] is_about,
    int64_t[::1] offset,
    int64_t[::1] place,
    int64_t[::1] number,
    uint8_t[::1] kind,
    int64_t[::1] happened,
    int64_t[::1] recorded,
    uint32_t[::1] door,
    int64_t[::1] messages_before,
    uint32_t[::1] kinds,
    int64_t[::1] least,
    int64_t[::1] greatest,
):
    """Walk the message records of chunks, and take their events apart into columns.

    Args:
        records: What holds the chunks' records.
        starts: Where those of each chunk begin …
        ends: … and end; messages fill the space between, at least one.
        first_event: Event number at which their segment begins.
        kind_of: Of each channel the kind of its events; 0: they are none.
        bit_of: Of each channel the bit of its records.
        length_of: Of each kind the length of its messages; -1: any.
        is_about: Of each kind, whether its events begin with the door that they are about.
        offset: For each message: where it begins.
        place: For each event, as the next five: which message it is.
        number: Its number.
        kind: Its kind.
        happened: When it happened.
        recorded: When it was recorded.
        door: The door that it is about; 0: none, or its kind is not among `is_about`.
        messages_before: For each chunk: how many messages there are to its end.
        kinds: The bits of its records.
        least: Its least log time …
        greatest: … and its greatest.

    Returns:
        How many messages, how many events, and whether one is not of its kind's length. `DAMAGED`
        or `TOO_MANY` as the first: nothing of the rest counts.
    """
    cdef int64_t size = records.shape[0], chunks = starts.shape[0], room = offset.shape[0]
    cdef int64_t at, end, problem = 0, i
    cdef Tables tables
    cdef Found found
    cdef Chunk chunk
    if kind_of.shape[0] < CHANNELS or bit_of.shape[0] < CHANNELS:
        raise ValueError("a table of channels that is too short")
    if length_of.shape[0] < KINDS or is_about.shape[0] < KINDS:
        raise ValueError("a table of kinds that is too short")
    if (
        ends.shape[0] != chunks or messages_before.shape[0] != chunks or kinds.shape[0] != chunks
        or least.shape[0] != chunks or greatest.shape[0] != chunks
    ):
        raise ValueError("columns of chunks of different lengths")
    if (
        place.shape[0] != room or number.shape[0] != room or kind.shape[0] != room
        or happened.shape[0] != room or recorded.shape[0] != room or door.shape[0] != room
    ):
        raise ValueError("columns of messages of different lengths")
    if not chunks or not size or not room:
        return DAMAGED if not chunks or not size else TOO_MANY, 0, False
    tables.kind_of, tables.bit_of = &kind_of[0], &bit_of[0]
    tables.length_of, tables.is_about = &length_of[0], &is_about[0]
    found.offset, found.place, found.number, found.kind = &offset[0], &place[0], &number[0], &kind[0]
    found.happened, found.recorded, found.door = &happened[0], &recorded[0], &door[0]
    found.room, found.messages, found.events, found.has_wrong_length = room, 0, 0, False
    with nogil:
        for i in range(chunks):
            at, end = starts[i], ends[i]
            if at < 0 or at >= end or end > size:
                problem = DAMAGED_
                break
            chunk.kinds, chunk.least, chunk.greatest = 0, INT64_MAX, INT64_MIN
            problem = _scan_chunk(&records[0], at, end, first_event, &tables, &found, &chunk)
            if problem:
                break
            messages_before[i] = found.messages
            kinds[i], least[i], greatest[i] = chunk.kinds, chunk.least, chunk.greatest
    if problem:
        return problem, 0, False
    return found.messages, found.events, bool(found.has_wrong_length)


def gather(
    const uint8_t[::1] records,
    const int64_t[::1] offsets,
    int64_t ahead,
    const int64_t[::1] places,
    int64_t size,
    uint8_t[::1] into,
):
    """Copy structs that lie anywhere, one behind the other; return whether all lie in there.

    Args:
        records: What holds them.
        offsets: Where things begin …
        ahead: … which have the struct so many bytes behind that.
        places: Which of these things.
        size: Bytes of a struct.
        into: Filled with them.
    """
    cdef int64_t count = places.shape[0], i, at, place, last = records.shape[0] - size
    cdef bint fits = True
    if size <= 0 or ahead < 0 or into.shape[0] != count * size:
        raise ValueError("no room for so many structs of that size")
    with nogil:
        for i in range(count):
            place = places[i]
            if place < 0 or place >= offsets.shape[0]:
                fits = False
                break
            at = offsets[place]
            if at < 0 or at > last - ahead:
                fits = False
                break
            memcpy(&into[i * size], &records[at + ahead], size)
    return bool(fits)


def sort_places(const uint8_t[::1] kinds, int64_t[::1] places, int64_t[::1] ends):
    """Sort the places 0, 1, 2 … by their kinds, those of one kind ascending.

    Args:
        kinds: The kind at each place.
        places: Filled with the places.
        ends: Filled with how many are of each kind, 0 to 255, or of one before it.
    """
    cdef int64_t count = kinds.shape[0], i, at, total = 0
    cdef int64_t[256] following
    if places.shape[0] != count or ends.shape[0] != KINDS:
        raise ValueError("columns of different lengths")
    with nogil:
        for i in range(KINDS):
            following[i] = 0
        for i in range(count):
            following[kinds[i]] += 1
        for i in range(KINDS):
            at = following[i]
            following[i] = total
            total += at
            ends[i] = total
        for i in range(count):
            at = following[kinds[i]]
            following[kinds[i]] = at + 1
            places[at] = i


def are_numbered(
    const int64_t[::1] numbers, const int64_t[::1] firsts, const int64_t[::1] ends
):
    """Return whether numbers are those from each of `firsts` to before each of `ends`."""
    cdef int64_t count = numbers.shape[0], spans = firsts.shape[0], at = 0, i, number
    cdef bint fits = True
    if ends.shape[0] != spans:
        raise ValueError("columns of different lengths")
    with nogil:
        for i in range(spans):
            number = firsts[i]
            while number < ends[i]:
                if at >= count or numbers[at] != number:
                    fits = False
                    break
                at += 1
                number += 1
            if not fits:
                break
    return bool(fits) and at == count


def keep_greatest(int64_t[::1] kept, const int64_t[::1] rows, const int64_t[::1] values):
    """Let each row keep the greatest value that was written to it; -1 is the last row.

    Args:
        kept: What each row holds.
        rows: Where each value is written to.
        values: As many.

    Raises:
        IndexError: A row is not there.
    """
    cdef int64_t count = rows.shape[0], room = kept.shape[0], i, row
    cdef bint fits = True
    if values.shape[0] != count:
        raise ValueError("columns of different lengths")
    with nogil:
        for i in range(count):
            row = rows[i]
            if row < 0:
                row += room
            if row < 0 or row >= room:
                fits = False
                break
            if values[i] > kept[row]:
                kept[row] = values[i]
    if not fits:
        raise IndexError("a row that is not there")


def settle(
    const int64_t[::1] positions,
    const int64_t[::1] rows,
    const int64_t[::1] happened,
    const int64_t[::1] numbers,
    int64_t[::1] kept_ns,
    int64_t[::1] kept_number,
    int64_t[::1] scratch,
    int64_t[::1] won,
):
    """Let each row of a register keep the write with the greatest (happened, number).

    Args:
        positions: Of the events that write to it.
        rows: To which row each event writes; -1 is the last.
        happened: When each event happened.
        numbers: The number of each.
        kept_ns: When what each row holds happened …
        kept_number: … and the number of its event; both are written to.
        scratch: As many, all -1; they are so again afterwards.
        won: Filled with the places, among `positions`, of the writes that stay; it has room for
            one a row, or one a position, whatever is less.

    Returns:
        How many stay.

    Raises:
        IndexError: A position or a row is not there.
    """
    cdef int64_t count = positions.shape[0], events = rows.shape[0], room = kept_ns.shape[0]
    cdef int64_t i, position, row, ns, number, touched = 0
    cdef bint fits = True
    if happened.shape[0] != events or numbers.shape[0] != events:
        raise ValueError("columns of events of different lengths")
    if kept_number.shape[0] != room or scratch.shape[0] != room:
        raise ValueError("columns of rows of different lengths")
    if won.shape[0] < min(count, room):
        raise ValueError("no room for those that win")
    with nogil:
        for i in range(count):
            position = positions[i]
            if position < 0 or position >= events:
                fits = False
                break
            row = rows[position]
            if row < 0:
                row += room
            if row < 0 or row >= room:
                fits = False
                break
            ns, number = happened[position], numbers[position]
            if ns < kept_ns[row] or (ns == kept_ns[row] and number <= kept_number[row]):
                continue
            kept_ns[row], kept_number[row] = ns, number
            if scratch[row] < 0:
                won[touched] = row
                touched += 1
            scratch[row] = i
        for i in range(touched):
            row = won[i]
            won[i] = scratch[row]
            scratch[row] = -1
    if not fits:
        raise IndexError("a write to a row that is not there")
    return touched
