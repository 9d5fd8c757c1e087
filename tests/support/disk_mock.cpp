// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A disk that stalls or refuses: goes before the program under test with LD_PRELOAD. What it does
// says the first octet of the file that MAPLET_DISK names: s stalls each flush for 2 s, e fails
// with EIO, f with ENOSPC, r with EROFS; anything else, or no file: nothing.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/types.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

namespace {

char mood() {
  const char* name = getenv("MAPLET_DISK");
  if (name == nullptr) return 0;
  const int fd = open(name, O_RDONLY | O_CLOEXEC);
  char c = 0;
  if (fd < 0) return 0;
  if (read(fd, &c, 1) != 1) c = 0;
  close(fd);
  return c;
}

int refused(char c) { return c == 'e' ? EIO : c == 'f' ? ENOSPC : c == 'r' ? EROFS : 0; }

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  const char c = mood();
  if (c == 's') usleep(2'000'000);
  if ((errno = refused(c)) != 0) return -1;
  return real(fd);
}

// With 64-bit offsets on 32 bits pwrite is pwrite64, fallocate fallocate64.
ssize_t pwrite(int fd, const void* bytes, size_t count, off_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite64");
  if ((errno = refused(mood())) != 0) return -1;
  return real(fd, bytes, count, at);
}

#if __SIZEOF_POINTER__ == 8
ssize_t pwrite64(int fd, const void* bytes, size_t count, off64_t at) {
  return pwrite(fd, bytes, count, at);
}
#endif

int fallocate(int fd, int mode, off_t at, off_t bytes) {
  static const auto real = next<int (*)(int, int, off_t, off_t)>("fallocate64");
  if ((errno = refused(mood())) != 0) return -1;
  return real(fd, mode, at, bytes);
}

}  // extern "C"
