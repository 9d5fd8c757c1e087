// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The kernel's side of one GPIO chip, in the process that uses it: the ioctls of ABI v1 on a file
// that the test shares (MAPLET_GPIO_MOCK; gpio_mock.py has the same layout). Levels are physical.
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <mutex>
#include <thread>

namespace {

constexpr unsigned kLines = 8;
constexpr unsigned kRing = 4096;

struct Line {
  char name[32];
  char consumer[32];  ///< not empty: taken
  std::uint8_t level;
  std::uint8_t unused[7];
};
struct Change {
  std::uint64_t at_ns;  ///< CLOCK_MONOTONIC
  std::uint32_t line;
  std::uint32_t level;
};
struct Shared {
  std::uint32_t gone;     ///< the chip was pulled out
  std::uint32_t inputs;   ///< how many changes the test has written
  std::uint32_t outputs;  ///< how many the program has
  std::uint32_t unused;
  Line lines[kLines];
  Change in[kRing];
  Change out[kRing];
};

/// A file descriptor that stands for a line.
struct Handle {
  int fd = -1;
  unsigned line = 0;
  bool active_low = false;
  int to_reader = -1;  ///< the pipe's other end, of an input with events
};

std::mutex mutex;
std::array<Handle, kLines> handles;
Shared* shared = nullptr;

/// Past our own close().
void shut(int fd) { syscall(SYS_close, fd); }

std::uint64_t now_ns() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000ULL +
         static_cast<std::uint64_t>(time.tv_nsec);
}

template <class T>
T load(T& value) {
  return std::atomic_ref<T>{value}.load(std::memory_order_acquire);
}

Handle* find(int fd) {
  for (Handle& handle : handles) {
    if (handle.fd == fd && fd >= 0) return &handle;
  }
  return nullptr;
}

/// Hands the test's changes to whoever listens.
void deliver() {
  std::uint32_t done = 0;
  for (;; usleep(300)) {
    const std::lock_guard lock{mutex};
    if (load(shared->gone) != 0) {
      for (Handle& handle : handles) {
        if (handle.to_reader >= 0) shut(handle.to_reader);
        handle.to_reader = -1;
      }
    }
    for (; done != load(shared->inputs); ++done) {
      const Change& change = shared->in[done % kRing];
      Line& line = shared->lines[change.line % kLines];
      if (line.level == change.level) continue;
      line.level = static_cast<std::uint8_t>(change.level);
      for (const Handle& handle : handles) {
        if (handle.to_reader < 0 || handle.line != change.line) continue;
        const bool on = (change.level != 0) != handle.active_low;
        const std::uint32_t kind = on ? GPIOEVENT_EVENT_RISING_EDGE : GPIOEVENT_EVENT_FALLING_EDGE;
        const gpioevent_data event{change.at_ns, kind};
        (void)!write(handle.to_reader, &event, sizeof event);
      }
    }
  }
}

bool open_shared() {
  if (shared != nullptr) return true;
  const char* path = std::getenv("MAPLET_GPIO_MOCK");
  const int fd = path == nullptr ? -1 : open(path, O_RDWR | O_CLOEXEC);
  if (fd < 0) return false;
  void* memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  shut(fd);
  if (memory == MAP_FAILED) return false;
  shared = static_cast<Shared*>(memory);
  std::thread{deliver}.detach();
  return true;
}

int failure(int error) {
  errno = error;
  return -1;
}

/// @param fd  made here, on success
int take(unsigned line, bool active_low, const char* consumer, bool events, int& fd) {
  if (line >= kLines) return failure(EINVAL);
  if (shared->lines[line].consumer[0] != '\0') return failure(EBUSY);
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return -1;
  if (!events) {
    shut(ends[1]);
    ends[1] = -1;
  }
  for (Handle& handle : handles) {
    if (handle.fd >= 0) continue;
    handle = {ends[0], line, active_low, ends[1]};
    std::strncpy(shared->lines[line].consumer, consumer, sizeof(Line::consumer) - 1);
    fd = ends[0];
    return 0;
  }
  return failure(ENOSPC);
}

void drive(const Handle& handle, bool on) {
  const auto level = static_cast<std::uint8_t>(on != handle.active_low);
  Line& line = shared->lines[handle.line];
  line.level = level;
  shared->out[shared->outputs % kRing] = {now_ns(), handle.line, level};
  std::atomic_ref<std::uint32_t>{shared->outputs}.fetch_add(1, std::memory_order_release);
}

int line_info(gpioline_info& info) {
  if (info.line_offset >= kLines) return failure(EINVAL);
  const Line& line = shared->lines[info.line_offset];
  info.flags = line.consumer[0] != '\0' ? GPIOLINE_FLAG_KERNEL : 0U;
  std::memcpy(info.name, line.name, sizeof info.name);
  std::memcpy(info.consumer, line.consumer, sizeof info.consumer);
  return 0;
}

int answer(int fd, unsigned long request, void* data) {
  const std::lock_guard lock{mutex};
  if (!open_shared()) return failure(ENOTTY);
  if (load(shared->gone) != 0) return failure(ENODEV);
  switch (request) {
    case GPIO_GET_CHIPINFO_IOCTL: {
      auto& info = *static_cast<gpiochip_info*>(data);
      std::strcpy(info.name, "gpiochip0");
      std::strcpy(info.label, "maplet-mock");
      info.lines = kLines;
      return 0;
    }
    case GPIO_GET_LINEINFO_IOCTL:
      return line_info(*static_cast<gpioline_info*>(data));
    case GPIO_GET_LINEHANDLE_IOCTL: {
      auto& wish = *static_cast<gpiohandle_request*>(data);
      const bool low = (wish.flags & GPIOHANDLE_REQUEST_ACTIVE_LOW) != 0;
      const int done = take(wish.lineoffsets[0], low, wish.consumer_label, false, wish.fd);
      if (done == 0 && (wish.flags & GPIOHANDLE_REQUEST_OUTPUT) != 0) {
        drive(*find(wish.fd), wish.default_values[0] != 0);
      }
      return done;
    }
    case GPIO_GET_LINEEVENT_IOCTL: {
      auto& wish = *static_cast<gpioevent_request*>(data);
      const bool low = (wish.handleflags & GPIOHANDLE_REQUEST_ACTIVE_LOW) != 0;
      return take(wish.lineoffset, low, wish.consumer_label, true, wish.fd);
    }
    case GPIOHANDLE_SET_LINE_VALUES_IOCTL: {
      const Handle* handle = find(fd);
      if (handle == nullptr) return failure(EBADF);
      drive(*handle, static_cast<gpiohandle_data*>(data)->values[0] != 0);
      return 0;
    }
    case GPIOHANDLE_GET_LINE_VALUES_IOCTL: {
      const Handle* handle = find(fd);
      if (handle == nullptr) return failure(EBADF);
      const bool high = load(shared->lines[handle->line].level) != 0;
      static_cast<gpiohandle_data*>(data)->values[0] = high != handle->active_low ? 1 : 0;
      return 0;
    }
    default:
      return failure(EINVAL);
  }
}

}  // namespace

extern "C" int ioctl(int fd, unsigned long request, ...) {
  va_list arguments;
  va_start(arguments, request);
  void* data = va_arg(arguments, void*);
  va_end(arguments);
  if (_IOC_TYPE(request) == 0xB4) return answer(fd, request, data);
  using Ioctl = int (*)(int, unsigned long, ...);
  static const auto next = reinterpret_cast<Ioctl>(dlsym(RTLD_NEXT, "ioctl"));
  return next(fd, request, data);
}

extern "C" int close(int fd) {
  if (shared != nullptr) {
    const std::lock_guard lock{mutex};
    if (Handle* handle = find(fd)) {
      shared->lines[handle->line].consumer[0] = '\0';
      if (handle->to_reader >= 0) shut(handle->to_reader);
      *handle = {};
    }
  }
  using Close = int (*)(int);
  static const auto next = reinterpret_cast<Close>(dlsym(RTLD_NEXT, "close"));
  return next(fd);
}
