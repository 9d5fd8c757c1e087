// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <boost/container/static_vector.hpp>

namespace maplet {

/// A vector whose capacity is part of its type. Exceeding it is a bug: check `full()` first.
template <class T, std::size_t Capacity>
using StaticVector = boost::container::static_vector<T, Capacity>;

template <class T, std::size_t Capacity>
[[nodiscard]] constexpr bool full(const StaticVector<T, Capacity>& items) noexcept {
  return items.size() == Capacity;
}

}  // namespace maplet
