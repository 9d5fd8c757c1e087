// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <vector>

#include "daemon/journal/store.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace maplet;

/// A file of whatever bytes.
class AnyFile final : public journal::BlockFile {
 public:
  explicit AnyFile(std::vector<std::byte> bytes) : bytes_{std::move(bytes)} {}
  std::size_t read(std::uint64_t at, std::span<std::byte> out) noexcept override {
    if (at >= bytes_.size()) return 0;
    const std::size_t count = std::min<std::size_t>(out.size(), bytes_.size() - at);
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), count, out.begin());
    return count;
  }
  bool write(std::uint64_t at, std::span<const std::byte> bytes) noexcept override {
    if (at + bytes.size() > kMost) return false;
    if (at + bytes.size() > bytes_.size()) bytes_.resize(at + bytes.size());
    std::ranges::copy(bytes, bytes_.begin() + static_cast<std::ptrdiff_t>(at));
    return true;
  }
  bool flush() noexcept override { return true; }
  std::uint64_t size() noexcept override { return bytes_.size(); }

 private:
  static constexpr std::uint64_t kMost = 1U << 24;
  std::vector<std::byte> bytes_;
};

struct Sound final : journal::Visitor {
  std::size_t items = 0;
  void take(const DeltaPoseRecord& record) noexcept override {
    fuzz::require(valid(record), "only sound delta-poses are taken");
    ++items;
  }
  void take(const RangeRecord& record) noexcept override {
    fuzz::require(valid(record), "only sound ranges are taken");
    ++items;
  }
};

}  // namespace

// A store of any bytes: the first octet 0 plays them as they are; else each head and payload gets
// right checksums first, so that what they hold is read. Then one goes on with it.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto input = fuzz::bytes(data + 1, size - 1);
  std::vector<std::byte> bytes{input.begin(), input.end()};
  if (data[0] != 0) {
    // The input is one payload; heads are ours.
    bytes.insert(bytes.begin(), journal::kHeadBytes, std::byte{});
    bytes.resize(std::min(bytes.size(), journal::kMaxTurnBytes));
    journal::TurnHead head{.life = {1, 7}, .generation = data[0], .half_pages = 32};
    journal::seal(head, bytes);
  }
  AnyFile file{bytes};
  std::vector<std::byte> scratch(3 * journal::kMaxTurnBytes);
  journal::Reader reader{file, std::span{scratch}.first(journal::kMaxTurnBytes)};
  const journal::Survey survey = reader.survey();
  Sound before;
  reader.read(survey, before);
  if (survey.state != journal::Survey::State::kGood) return 0;
  journal::Store store{file, std::span{scratch}.subspan(journal::kMaxTurnBytes)};
  if (!store.go_on(survey, {})) return 0;
  std::vector<std::byte> buffer(journal::kMaxTurnBytes);
  journal::TurnBuilder turn{buffer, survey.life};
  turn.know_ends(survey.ends);
  (void)turn.add(journal::Part{});
  if (!store.append(turn, {})) return 0;
  Sound after;
  const journal::Survey again = reader.survey();
  reader.read(again, after);
  fuzz::require(again.state == journal::Survey::State::kGood, "a turn that was appended counts");
  return 0;
}
