/* Stands between a program and the C library for the calls that change one folder.
 *
 * Loaded with LD_PRELOAD (shim.py compiles and loads it). It counts the calls that touch files
 * under a folder; it can record them with their bytes, and at the n-th call end the process, write
 * a half of what was asked, or fail as a bad or full disk does. Nothing outside the folder is
 * touched. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

/* The numbers are shim.py's, too. */
enum call { OPEN = 1, WRITE = 2, FSYNC = 4, FDATASYNC = 8, RENAME = 16, UNLINK = 32,
            TRUNCATE = 64, MKDIR = 128, CLOSE = 256, LOOK = 512, OTHER = 1024, NOTE = 2048,
            LINK = 4096 };
enum action { PASS = 0, KILL = 1, HALF_THEN_KILL = 2, FAIL = 3, HALF_THEN_FAIL = 4, SHORT = 5 };

struct entry { uint32_t call; int32_t fd; int64_t number; uint32_t path, other; uint64_t data; };

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static char root[PATH_MAX];
static size_t root_length;
static int record_fd = -1;
static unsigned char ours[1 << 16]; /* file descriptor -> opened under the folder */

static unsigned armed_calls;
static int armed_action, armed_error;
static long armed_from, armed_until, seen;

/* ---- what Python calls ------------------------------------------------------------------ */

void shim_watch(const char *folder, int fd) {
    memset(ours, 0, sizeof ours);
    root_length = strlen(folder);
    memcpy(root, folder, root_length + 1);
    record_fd = fd;
    seen = 0;
}

/* At the calls numbered from <= n < until among those of `calls`, counted from 0: do that. */
void shim_arm(unsigned calls, int action, long from, long until, int error) {
    armed_calls = calls;
    armed_action = action;
    armed_from = from;
    armed_until = until;
    armed_error = error;
    seen = 0;
}

long shim_seen(void) { return seen; }

/* ---- recording -------------------------------------------------------------------------- */

static void put(const void *data, size_t size) {
    const char *at = data;
    while (size) {
        ssize_t done = syscall(SYS_write, record_fd, at, size);
        if (done < 0) {
            if (errno == EINTR) continue;
            raise(SIGABRT); /* a recording with a hole would prove nothing */
        }
        at += done;
        size -= done;
    }
}

static void record(enum call call, int fd, int64_t number, const char *path, const char *other,
                   const void *data, size_t size) {
    if (record_fd < 0) return;
    int error = errno;
    struct entry entry = {call, fd, number, path ? strlen(path) : 0, other ? strlen(other) : 0,
                          size};
    put(&entry, sizeof entry);
    if (path) put(path, entry.path);
    if (other) put(other, entry.other);
    put(data, size);
    errno = error;
}

void shim_note(const char *data, size_t size) {
    pthread_mutex_lock(&lock);
    record(NOTE, -1, 0, NULL, NULL, data, size);
    pthread_mutex_unlock(&lock);
}

/* ---- deciding --------------------------------------------------------------------------- */

static int is_inside(const char *path) {
    return root_length && path && !strncmp(path, root, root_length) &&
           (path[root_length] == '/' || !path[root_length]);
}

/* The whole path of a name in an open folder; in `room`, of PATH_MAX bytes, if it must be made. */
static const char *whole(int directory, const char *path, char *room) {
    if (!path || path[0] == '/' || directory == AT_FDCWD || !root_length) return path;
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", directory);
    ssize_t length = syscall(SYS_readlinkat, AT_FDCWD, link, room, PATH_MAX - 1);
    if (length < 0 || length + strlen(path) + 2 > PATH_MAX) return path;
    room[length] = 0;
    if (strcmp(path, ".")) {
        room[length] = '/';
        strcpy(room + length + 1, path);
    }
    return room;
}

static int is_ours(int fd) { return root_length && fd >= 0 && fd < (int)sizeof ours && ours[fd]; }

static enum action decide(enum call call) {
    if (!(call & armed_calls)) return PASS;
    long n = seen++;
    if (n < armed_from || n >= armed_until) return PASS;
    if (armed_action == KILL) kill(getpid(), SIGKILL);
    return armed_action;
}

/* For a call that can only be done or not: -1 with errno if it must not be done. */
static int refused(enum call call) {
    switch (decide(call)) {
    case FAIL:
    case HALF_THEN_FAIL:
        errno = armed_error;
        return -1;
    case HALF_THEN_KILL:
        kill(getpid(), SIGKILL);
    default:
        return 0;
    }
}

#define REAL(name) static __typeof__(name) *real; if (!real) real = dlsym(RTLD_NEXT, #name)
#define ENTER pthread_mutex_lock(&lock)
#define LEAVE(value) do { __typeof__(value) v_ = (value); int e_ = errno; \
    pthread_mutex_unlock(&lock); errno = e_; return v_; } while (0)

/* ---- the calls -------------------------------------------------------------------------- */

static int opened(const char *name, int flags, mode_t mode, int directory) {
    char room[PATH_MAX];
    const char *path = whole(directory, name, room);
    if (!is_inside(path)) return syscall(SYS_openat, directory, name, flags, mode);
    ENTER;
    enum call call = flags & (O_CREAT | O_TRUNC) ? OPEN : LOOK;
    if (refused(call)) LEAVE(-1);
    int fd = syscall(SYS_openat, directory, name, flags, mode);
    if (fd >= 0 && fd < (int)sizeof ours) {
        ours[fd] = 1;
        record(call, fd, flags, path, NULL, NULL, 0);
    }
    LEAVE(fd);
}

static mode_t mode_of(int flags, va_list rest) {
    return flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;
}

#define OPENS(name, parameters, directory) \
    int name parameters { va_list rest; va_start(rest, flags); mode_t mode = mode_of(flags, rest); \
                          va_end(rest); return opened(path, flags, mode, directory); }
OPENS(open, (const char *path, int flags, ...), AT_FDCWD)
OPENS(open64, (const char *path, int flags, ...), AT_FDCWD)
OPENS(openat, (int directory, const char *path, int flags, ...), directory)
OPENS(openat64, (int directory, const char *path, int flags, ...), directory)

int close(int fd) {
    if (!is_ours(fd)) return syscall(SYS_close, fd);
    ENTER;
    ours[fd] = 0;
    record(CLOSE, fd, 0, NULL, NULL, NULL, 0);
    LEAVE(syscall(SYS_close, fd));
}

/* at < 0: where the file descriptor stands, or the file's end with O_APPEND */
static ssize_t really_write(int fd, const void *data, size_t size, off_t at) {
    off_t place = at;
    if (at < 0) {
        struct stat status;
        int appends = fcntl(fd, F_GETFL) & O_APPEND;
        place = appends && !fstat(fd, &status) ? status.st_size : lseek(fd, 0, SEEK_CUR);
    }
    ssize_t done = at < 0 ? syscall(SYS_write, fd, data, size)
                          : syscall(SYS_pwrite64, fd, data, size, at);
    if (done > 0) record(WRITE, fd, place, NULL, NULL, data, done);
    return done;
}

static ssize_t written(int fd, const void *data, size_t size, off_t at) {
    ENTER;
    switch (decide(WRITE)) {
    case HALF_THEN_KILL:
        really_write(fd, data, size / 2, at);
        kill(getpid(), SIGKILL);
    case SHORT:
        LEAVE(really_write(fd, data, size > 1 ? size / 2 : size, at));
    case HALF_THEN_FAIL:
        really_write(fd, data, size / 2, at);
    case FAIL:
        errno = armed_error;
        LEAVE((ssize_t)-1);
    default:
        LEAVE(really_write(fd, data, size, at));
    }
}

ssize_t write(int fd, const void *data, size_t size) {
    return is_ours(fd) ? written(fd, data, size, -1) : syscall(SYS_write, fd, data, size);
}

ssize_t pwrite64(int fd, const void *data, size_t size, off_t at) {
    return is_ours(fd) ? written(fd, data, size, at) : syscall(SYS_pwrite64, fd, data, size, at);
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t at) {
    return pwrite64(fd, data, size, at);
}

/* Several pieces are written one after the other: for the folder it is the same. */
ssize_t writev(int fd, const struct iovec *pieces, int count) {
    if (!is_ours(fd)) return syscall(SYS_writev, fd, pieces, count);
    ssize_t all = 0;
    for (int i = 0; i < count; i++) {
        ssize_t done = written(fd, pieces[i].iov_base, pieces[i].iov_len, -1);
        if (done < 0) return all ? all : -1;
        all += done;
        if ((size_t)done < pieces[i].iov_len) break;
    }
    return all;
}

static int synced(enum call call, int number, int fd) {
    if (!is_ours(fd)) return syscall(number, fd);
    ENTER;
    if (refused(call)) LEAVE(-1);
    int done = syscall(number, fd);
    if (!done) record(call, fd, 0, NULL, NULL, NULL, 0);
    LEAVE(done);
}

int fsync(int fd) { return synced(FSYNC, SYS_fsync, fd); }
int fdatasync(int fd) { return synced(FDATASYNC, SYS_fdatasync, fd); }

int ftruncate64(int fd, off_t size) {
    if (!is_ours(fd)) return syscall(SYS_ftruncate, fd, size);
    ENTER;
    if (refused(TRUNCATE)) LEAVE(-1);
    int done = syscall(SYS_ftruncate, fd, size);
    if (!done) record(TRUNCATE, fd, size, NULL, NULL, NULL, 0);
    LEAVE(done);
}

int ftruncate(int fd, off_t size) { return ftruncate64(fd, size); }

static int renamed(enum call call, int number, int from, const char *name, int to,
                   const char *new_name) {
    char room[PATH_MAX], new_room[PATH_MAX];
    const char *path = whole(from, name, room), *other = whole(to, new_name, new_room);
    if (!is_inside(path) && !is_inside(other))
        return syscall(number, from, name, to, new_name, 0);
    ENTER;
    if (refused(call)) LEAVE(-1);
    int done = syscall(number, from, name, to, new_name, 0);
    if (!done) record(call, -1, 0, path, other, NULL, 0);
    LEAVE(done);
}

int rename(const char *path, const char *other) {
    return renamed(RENAME, SYS_renameat, AT_FDCWD, path, AT_FDCWD, other);
}

int renameat(int from, const char *path, int to, const char *other) {
    return renamed(RENAME, SYS_renameat, from, path, to, other);
}

int link(const char *path, const char *other) {
    return renamed(LINK, SYS_linkat, AT_FDCWD, path, AT_FDCWD, other);
}

int linkat(int from, const char *path, int to, const char *other, int flags) {
    (void)flags; /* nothing here follows links */
    return renamed(LINK, SYS_linkat, from, path, to, other);
}

static int unlinked(int directory, const char *name, int flags) {
    char room[PATH_MAX];
    const char *path = whole(directory, name, room);
    if (!is_inside(path)) return syscall(SYS_unlinkat, directory, name, flags);
    ENTER;
    if (refused(UNLINK)) LEAVE(-1);
    int done = syscall(SYS_unlinkat, directory, name, flags);
    if (!done) record(UNLINK, -1, flags, path, NULL, NULL, 0);
    LEAVE(done);
}

int unlink(const char *path) { return unlinked(AT_FDCWD, path, 0); }
int unlinkat(int directory, const char *path, int flags) {
    return unlinked(directory, path, flags);
}
int rmdir(const char *path) { return unlinked(AT_FDCWD, path, AT_REMOVEDIR); }

static int made(int directory, const char *path, mode_t mode) {
    if (!is_inside(path)) return syscall(SYS_mkdirat, directory, path, mode);
    ENTER;
    if (refused(MKDIR)) LEAVE(-1);
    int done = syscall(SYS_mkdirat, directory, path, mode);
    if (!done) record(MKDIR, -1, mode, path, NULL, NULL, 0);
    LEAVE(done);
}

int mkdir(const char *path, mode_t mode) { return made(AT_FDCWD, path, mode); }
int mkdirat(int directory, const char *path, mode_t mode) { return made(directory, path, mode); }

/* ---- calls that would change a file behind the recording's back: said, so that it stops --- */

ssize_t copy_file_range(int in, off64_t *from, int out, off64_t *to, size_t size, unsigned flags) {
    REAL(copy_file_range);
    if (is_ours(out)) record(OTHER, out, 0, "copy_file_range", NULL, NULL, 0);
    return real(in, from, out, to, size, flags);
}

ssize_t sendfile64(int out, int in, off64_t *from, size_t size) {
    if (is_ours(out)) record(OTHER, out, 0, "sendfile", NULL, NULL, 0);
    return syscall(SYS_sendfile, out, in, from, size);
}

int posix_fallocate64(int fd, off64_t from, off64_t size) {
    REAL(posix_fallocate64);
    if (is_ours(fd)) record(OTHER, fd, 0, "posix_fallocate", NULL, NULL, 0);
    return real(fd, from, size);
}

int truncate64(const char *path, off_t size) {
    if (is_inside(path)) record(OTHER, -1, 0, "truncate", NULL, NULL, 0);
    return syscall(SYS_truncate, path, size);
}
