// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/uri.hpp"

#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  const auto uri = Uri::parse(fuzz::text(data, size));
  if (!uri) {
    fuzz::require_one_line(uri.error());
    return 0;
  }
  fuzz::require(!uri->scheme.empty(), "a URI has a scheme");
  if (const auto known = uri->only({"first"}); !known) fuzz::require_one_line(known.error());
  for (const auto& [key, value] : uri->parameters) {
    const auto count = uri->count(key, 0, 3, 1000);
    if (!count) fuzz::require_one_line(count.error());
    fuzz::require(!count || (*count >= 3 && *count <= 1000), "a count is within its range");
  }
  return 0;
}
