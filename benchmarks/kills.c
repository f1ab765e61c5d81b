/* Ends the process with SIGKILL at the n-th call that changes a file below a folder; preloaded by kills.py. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static char below[PATH_MAX];
static int torn; /* whether half of what is to be written is written first */
static long left, calls;

/* Count calls below `folder` from now on and end at the `at`-th of them, 0: at none. */
void kills_arm(const char *folder, long at, int half)
{
    snprintf(below, sizeof below, "%s", folder);
    torn = half;
    calls = 0;
    left = at;
}

long kills_counted(void) { return __atomic_load_n(&calls, __ATOMIC_SEQ_CST); }

static int is_below(const char *path) { return below[0] && path && !strncmp(path, below, strlen(below)); }

static int writes_below(int file)
{
    char link[64], path[PATH_MAX];
    ssize_t size;
    if (!below[0])
        return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    size = readlink(link, path, sizeof path - 1);
    if (size < 0)
        return 0;
    path[size] = 0;
    return is_below(path);
}

static int is_due(void) { return __atomic_add_fetch(&calls, 1, __ATOMIC_SEQ_CST) == left; }

static void end(void)
{
    kill(getpid(), SIGKILL);
    for (;;)
        pause();
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t write(int file, const void *data, size_t size)
{
    if (writes_below(file) && is_due()) {
        if (torn)
            REAL(write)(file, data, size / 2);
        end();
    }
    return REAL(write)(file, data, size);
}

#define PWRITE(name, offset_t)                                              \
    ssize_t name(int file, const void *data, size_t size, offset_t offset)  \
    {                                                                       \
        if (writes_below(file) && is_due()) {                               \
            if (torn)                                                       \
                REAL(name)(file, data, size / 2, offset);                   \
            end();                                                          \
        }                                                                   \
        return REAL(name)(file, data, size, offset);                        \
    }
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)

#define ON_FILE(name)                         \
    int name(int file)                        \
    {                                         \
        if (writes_below(file) && is_due())   \
            end();                            \
        return REAL(name)(file);              \
    }
ON_FILE(fsync)
ON_FILE(fdatasync)

#define TRUNCATE(name, offset_t)              \
    int name(int file, offset_t size)         \
    {                                         \
        if (writes_below(file) && is_due())   \
            end();                            \
        return REAL(name)(file, size);        \
    }
TRUNCATE(ftruncate, off_t)
TRUNCATE(ftruncate64, off64_t)

int unlink(const char *path)
{
    if (is_below(path) && is_due())
        end();
    return REAL(unlink)(path);
}

int rename(const char *from, const char *to)
{
    if ((is_below(from) || is_below(to)) && is_due())
        end();
    return REAL(rename)(from, to);
}

#define OPEN(name)                                              \
    int name(const char *path, int flags, ...)                  \
    {                                                           \
        mode_t mode = 0;                                        \
        if (flags & (O_CREAT | O_TMPFILE)) {                    \
            va_list rest;                                       \
            va_start(rest, flags);                              \
            mode = va_arg(rest, mode_t);                        \
            va_end(rest);                                       \
        }                                                       \
        if ((flags & O_CREAT) && is_below(path) && access(path, F_OK) && is_due()) \
            end();                                              \
        return REAL(name)(path, flags, mode);                   \
    }
OPEN(open)
OPEN(open64)
