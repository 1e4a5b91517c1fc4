/* A disk that fails on demand: loaded before the C library (LD_PRELOAD), it delays or refuses every write to a regular file
   while the file named by DISK_FAULT says so: `s` stalls, `f` is full. Pipes, sockets and terminals are untouched. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static int fault(void) {
    const char *path = getenv("DISK_FAULT");
    char what = 0;
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, "open");
    int fd = path ? real(path, O_RDONLY | O_CLOEXEC) : -1;
    if (fd < 0) return 0;
    if (read(fd, &what, 1) != 1) what = 0;
    close(fd);
    return what;
}

/* Waits for a stalled disk; whether it is full. */
static int is_full(void) {
    int what;
    while ((what = fault()) == 's') usleep(20000);
    if (what == 'f') errno = ENOSPC;
    return what == 'f';
}

static int is_file(int fd) {
    struct stat about;
    return fstat(fd, &about) == 0 && S_ISREG(about.st_mode);
}

ssize_t write(int fd, const void *bytes, size_t length) {
    static ssize_t (*real)(int, const void *, size_t);
    if (!real) real = dlsym(RTLD_NEXT, "write");
    return is_file(fd) && is_full() ? -1 : real(fd, bytes, length);
}

ssize_t writev(int fd, const struct iovec *parts, int count) {
    static ssize_t (*real)(int, const struct iovec *, int);
    if (!real) real = dlsym(RTLD_NEXT, "writev");
    return is_file(fd) && is_full() ? -1 : real(fd, parts, count);
}

/* A stalled disk creates no file either; a full one does. */
static int opened(const char *name, const char *path, int flags, mode_t mode) {
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, name);
    if (flags & O_CREAT) while (fault() == 's') usleep(20000);
    return real(path, flags, mode);
}

int open(const char *path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    mode_t mode = flags & O_CREAT ? va_arg(more, int) : 0;
    va_end(more);
    return opened("open", path, flags, mode);
}

int open64(const char *path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    mode_t mode = flags & O_CREAT ? va_arg(more, int) : 0;
    va_end(more);
    return opened("open64", path, flags, mode);
}
