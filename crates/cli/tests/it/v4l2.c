// A camera for tests: put before the C library (LD_PRELOAD), it answers the requests of Video4Linux for /dev/video9, as the kernel's
// header declares them, with the frames of a file: for each, its length in four bytes (least first) and its bytes.
//
// FAKE_FRAMES: the file. FAKE_FORMAT: MJPG or YUYV. FAKE_FAULT: "busy" (another program streams), "gone" (unplugged after 10
// frames), "short" (every second buffer is cut in half), "gap" (in every second buffer bytes are missing in the middle, but not its end),
// "stampless" (buffers have no time), "realtime" (buffers have the time of day, as those of old drivers), "long" (16 bytes too many), or nothing.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

enum { WIDTH = 320, HEIGHT = 240, RATE = 30, BUFFERS = 8, LENGTH = WIDTH * HEIGHT * 2 };

static int device = -1;
static unsigned char *memory[BUFFERS];
static unsigned queue[BUFFERS], queued, requested, sequence;
static double next_at;
static FILE *frames;

static double at(clockid_t clock) {
    struct timespec time;
    clock_gettime(clock, &time);
    return time.tv_sec + time.tv_nsec * 1e-9;
}

static double now(void) {
    return at(CLOCK_MONOTONIC);
}

static int fault(const char *name) {
    const char *set = getenv("FAKE_FAULT");
    return set && !strcmp(set, name);
}

static unsigned code(void) {
    const char *name = getenv("FAKE_FORMAT");
    return v4l2_fourcc(name[0], name[1], name[2], name[3]);
}

static int opened(const char *path, int flags, mode_t mode, const char *name) {
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, name);
    if (strcmp(path, "/dev/video9")) return real(path, flags, mode);
    // A character device of the kernel, for those who look.
    return device = real("/dev/null", O_RDWR | O_CLOEXEC);
}

int open(const char *path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    mode_t mode = va_arg(more, int);
    va_end(more);
    return opened(path, flags, mode, "open");
}

int open64(const char *path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    mode_t mode = va_arg(more, int);
    va_end(more);
    return opened(path, flags, mode, "open64");
}

static void *mapped(void *at, size_t length, int protection, int flags, int fd, off_t offset, const char *name) {
    void *(*real)(void *, size_t, int, int, int, off_t) = dlsym(RTLD_NEXT, name);
    if (fd < 0 || fd != device) return real(at, length, protection, flags, fd, offset);
    unsigned index = offset / LENGTH;
    memory[index] = real(NULL, length, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return memory[index];
}

void *mmap(void *at, size_t length, int protection, int flags, int fd, off_t offset) {
    return mapped(at, length, protection, flags, fd, offset, "mmap");
}

void *mmap64(void *at, size_t length, int protection, int flags, int fd, off_t offset) {
    return mapped(at, length, protection, flags, fd, offset, "mmap64");
}

static int refuse(int error) {
    errno = error;
    return -1;
}

// The next frame of the file; from its beginning after its end.
static unsigned fill(unsigned char *into) {
    unsigned char length[4];
    if (!frames) frames = fopen(getenv("FAKE_FRAMES"), "rb");
    if (fread(length, 1, 4, frames) != 4) {
        rewind(frames);
        if (fread(length, 1, 4, frames) != 4) abort();
    }
    unsigned size = length[0] | length[1] << 8 | length[2] << 16;
    if (size > LENGTH || fread(into, 1, size, frames) != size) abort();
    if (fault("gap") && sequence % 2) {
        // A packet was lost.
        unsigned lost = size / 8;
        memmove(into + size / 2, into + size / 2 + lost, size - size / 2 - lost);
        return size - lost;
    }
    if (fault("long")) return size + 16;
    return fault("short") && sequence % 2 ? size / 2 : size;
}

static int dequeue(struct v4l2_buffer *buffer) {
    if (fault("gone") && sequence >= 10) return refuse(ENODEV);
    if (!queued) return refuse(EINVAL);
    if (next_at == 0) next_at = now();
    while (now() < next_at) usleep(1000);
    next_at += 1.0 / RATE;
    buffer->index = queue[0];
    memmove(queue, queue + 1, --queued * sizeof queue[0]);
    buffer->bytesused = fill(memory[buffer->index]);
    buffer->length = LENGTH;
    buffer->field = V4L2_FIELD_NONE;
    int wall = fault("realtime");
    buffer->flags = V4L2_BUF_FLAG_MAPPED | (wall ? V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN : V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC);
    buffer->sequence = sequence++;
    // Exposed 20 ms ago.
    double captured = fault("stampless") ? 0 : at(wall ? CLOCK_REALTIME : CLOCK_MONOTONIC) - 0.02;
    buffer->timestamp.tv_sec = (long)captured;
    buffer->timestamp.tv_usec = (long)((captured - (long)captured) * 1e6);
    return 0;
}

static int answer(unsigned long request, void *what) {
    switch (request) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *caps = what;
        memset(caps, 0, sizeof *caps);
        strcpy((char *)caps->driver, "fake");
        strcpy((char *)caps->card, "A camera for tests");
        caps->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        caps->capabilities = caps->device_caps | V4L2_CAP_DEVICE_CAPS;
        return 0;
    }
    case VIDIOC_ENUM_FMT: {
        struct v4l2_fmtdesc *format = what;
        if (format->index > 0 || format->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) return refuse(EINVAL);
        format->pixelformat = code();
        strcpy((char *)format->description, "frames of a file");
        return 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
        struct v4l2_frmsizeenum *size = what;
        if (size->index > 0 || size->pixel_format != code()) return refuse(EINVAL);
        size->type = V4L2_FRMSIZE_TYPE_DISCRETE;
        size->discrete.width = WIDTH;
        size->discrete.height = HEIGHT;
        return 0;
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
        struct v4l2_frmivalenum *interval = what;
        if (interval->index > 0 || interval->width != WIDTH) return refuse(EINVAL);
        interval->type = V4L2_FRMIVAL_TYPE_DISCRETE;
        interval->discrete.numerator = 1;
        interval->discrete.denominator = RATE;
        return 0;
    }
    case VIDIOC_ENUMINPUT: {
        struct v4l2_input *input = what;
        if (input->index > 0) return refuse(EINVAL);
        strcpy((char *)input->name, "only");
        input->type = V4L2_INPUT_TYPE_CAMERA;
        return 0;
    }
    case VIDIOC_G_INPUT:
        *(int *)what = 0;
        return 0;
    case VIDIOC_S_INPUT:
        return 0;
    case VIDIOC_G_FMT:
    case VIDIOC_TRY_FMT:
    case VIDIOC_S_FMT: {
        struct v4l2_format *format = what;
        if (fault("busy") && request == VIDIOC_S_FMT) return refuse(EBUSY);
        if (format->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) return refuse(EINVAL);
        format->fmt.pix.width = WIDTH;
        format->fmt.pix.height = HEIGHT;
        format->fmt.pix.pixelformat = code();
        format->fmt.pix.field = V4L2_FIELD_NONE;
        format->fmt.pix.bytesperline = code() == V4L2_PIX_FMT_YUYV ? 2 * WIDTH : 0;
        format->fmt.pix.sizeimage = LENGTH;
        return 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
        struct v4l2_streamparm *parameters = what;
        parameters->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
        parameters->parm.capture.timeperframe.numerator = 1;
        parameters->parm.capture.timeperframe.denominator = RATE;
        return 0;
    }
    case VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *buffers = what;
        if (buffers->count > BUFFERS) buffers->count = BUFFERS;
        requested = buffers->count;
        return 0;
    }
    case VIDIOC_QUERYBUF: {
        struct v4l2_buffer *buffer = what;
        if (buffer->index >= requested) return refuse(EINVAL);
        buffer->length = LENGTH;
        buffer->m.offset = buffer->index * LENGTH;
        return 0;
    }
    case VIDIOC_QBUF: {
        struct v4l2_buffer *buffer = what;
        if (buffer->index >= requested || queued >= BUFFERS) return refuse(EINVAL);
        queue[queued++] = buffer->index;
        return 0;
    }
    case VIDIOC_DQBUF:
        return dequeue(what);
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
        return 0;
    default:
        return refuse(ENOTTY);
    }
}

int ioctl(int fd, unsigned long request, ...) {
    va_list more;
    va_start(more, request);
    void *what = va_arg(more, void *);
    va_end(more);
    if (fd >= 0 && fd == device) return answer((unsigned)request, what);
    int (*real)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
    return real(fd, request, what);
}

int close(int fd) {
    int (*real)(int) = dlsym(RTLD_NEXT, "close");
    if (fd >= 0 && fd == device) device = -1;
    return real(fd);
}
