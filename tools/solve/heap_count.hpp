// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace maplet::graphs {

/// Calls of malloc, calloc, realloc and aligned variants on this thread so far; the program that
/// links heap_count.cpp counts them. Constant under sanitizers, which have their own malloc.
[[nodiscard]] std::uint64_t heap_allocations() noexcept;

}  // namespace maplet::graphs
