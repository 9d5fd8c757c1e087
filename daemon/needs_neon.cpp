// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// 32-bit ARM: said before any initialiser, of ours or of a library, uses what is not there.
#if defined(__arm__)
#include <asm/hwcap.h>
#include <string.h>
#include <sys/auxv.h>
#include <unistd.h>

namespace {

void say(const char* words) { (void)!write(STDERR_FILENO, words, strlen(words)); }

void needs_neon(int argc, char** argv, char**) {
  if ((getauxval(AT_HWCAP) & HWCAP_NEON) != 0) return;
  const char* path = argc > 0 ? argv[0] : "mapletd";
  const char* slash = strrchr(path, '/');
  say(slash != nullptr ? slash + 1 : path);
  say(": this processor has no NEON, which the 32-bit ARM build needs\n");
  _exit(1);
}

}  // namespace

[[gnu::section(".preinit_array"), gnu::used]] static void (*const before_all)(int, char**,
                                                                              char**) = needs_neon;
#endif
