/* Preloaded into the command line: makes the Nth of its file calls fail, or kills the process there.
 *
 * Counted are opens that create, writes, fsyncs and renames, of files only, and forks. FAULT_AT is N, from 1;
 * FAULT_KIND is "before" (killed in place of the call), "half" (killed after half of a write, or in place of another
 * call), "after" (killed right after the call) or a number, the errno that the call fails with. SIGKILL, as kill -9
 * sends it. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int calls;

static const char* kind_here(void) {
  const char* at = getenv("FAULT_AT");
  const char* kind = getenv("FAULT_KIND");
  return at != NULL && kind != NULL && ++calls == atoi(at) ? kind : NULL;
}

static int is(const char* kind, const char* name) { return kind != NULL && strcmp(kind, name) == 0; }

/* -1 where the call has to fail. */
static int before(const char* kind) {
  if (kind == NULL || is(kind, "after")) return 0;
  if (is(kind, "before") || is(kind, "half")) raise(SIGKILL);
  errno = atoi(kind);
  return -1;
}

static void after(const char* kind) {
  if (is(kind, "after")) raise(SIGKILL);
}

static int open_with(const char* name, const char* path, int flags, int mode) {
  int (*const real)(const char*, int, ...) = (int (*)(const char*, int, ...))dlsym(RTLD_NEXT, name);
  const char* kind = (flags & O_CREAT) != 0 ? kind_here() : NULL;
  if (before(kind) != 0) return -1;
  const int file = real(path, flags, mode);
  after(kind);
  return file;
}

static int mode_of(int flags, va_list rest) { return (flags & O_CREAT) != 0 ? va_arg(rest, int) : 0; }

int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const int mode = mode_of(flags, rest);
  va_end(rest);
  return open_with("open", path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const int mode = mode_of(flags, rest);
  va_end(rest);
  return open_with("open64", path, flags, mode);
}

ssize_t write(int file, const void* bytes, size_t size) {
  ssize_t (*const real)(int, const void*, size_t) = (ssize_t(*)(int, const void*, size_t))dlsym(RTLD_NEXT, "write");
  const char* kind = file > 2 ? kind_here() : NULL;
  if (is(kind, "half") && real(file, bytes, size / 2) >= 0) raise(SIGKILL);
  if (before(kind) != 0) return -1;
  const ssize_t written = real(file, bytes, size);
  after(kind);
  return written;
}

int fsync(int file) {
  int (*const real)(int) = (int (*)(int))dlsym(RTLD_NEXT, "fsync");
  const char* kind = kind_here();
  if (before(kind) != 0) return -1;
  const int result = real(file);
  after(kind);
  return result;
}

pid_t fork(void) {
  pid_t (*const real)(void) = (pid_t(*)(void))dlsym(RTLD_NEXT, "fork");
  const char* kind = kind_here();
  if (before(kind) != 0) return -1;
  const pid_t child = real();
  after(kind);
  return child;
}

int rename(const char* from, const char* to) {
  int (*const real)(const char*, const char*) = (int (*)(const char*, const char*))dlsym(RTLD_NEXT, "rename");
  const char* kind = kind_here();
  if (before(kind) != 0) return -1;
  const int result = real(from, to);
  after(kind);
  return result;
}
