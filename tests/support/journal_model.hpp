// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstring>
#include <map>
#include <random>
#include <vector>

#include "daemon/journal/store.hpp"
#include "tests/support/records.hpp"

namespace maplet::test {

/// A file on a disk that loses its power: what was flushed is safe; of the rest any sector may be
/// there, or what stood there before, in whatever order it was written.
class ModelFile final : public journal::BlockFile {
 public:
  static constexpr std::size_t kSector = 512;

  explicit ModelFile(std::size_t bytes) : safe_(bytes), now_(bytes) {}

  std::size_t read(std::uint64_t at, std::span<std::byte> out) noexcept override {
    if (at >= now_.size()) return 0;
    const std::size_t count =
        static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), now_.size() - at));
    std::memcpy(out.data(), now_.data() + at, count);
    return count;
  }
  bool write(std::uint64_t at, std::span<const std::byte> bytes) noexcept override {
    if (at + bytes.size() > now_.size() || operations_left_ == 0) return false;
    --operations_left_;
    writes_.push_back({at, {bytes.begin(), bytes.end()}});
    std::memcpy(now_.data() + at, bytes.data(), bytes.size());
    return true;
  }
  bool flush() noexcept override {
    if (operations_left_ == 0) return false;
    --operations_left_;
    safe_ = now_;
    writes_.clear();
    return true;
  }
  std::uint64_t size() noexcept override { return now_.size(); }

  /// The power goes after so many more writes and flushes.
  void stop_after(std::uint64_t operations) { operations_left_ = operations; }
  [[nodiscard]] bool stopped() const { return operations_left_ == 0; }

  /// The power was away. Of each sector any of the states that it went through may be left.
  void lose_power(std::mt19937& rng) {
    std::map<std::size_t, std::vector<std::vector<std::byte>>> states;
    std::vector<std::byte> disk = safe_;
    for (const auto& [at, bytes] : writes_) {
      std::memcpy(disk.data() + at, bytes.data(), bytes.size());
      for (auto s = static_cast<std::size_t>(at / kSector); s * kSector < at + bytes.size(); ++s) {
        const auto first = disk.begin() + static_cast<std::ptrdiff_t>(s * kSector);
        states[s].emplace_back(first, first + kSector);
      }
    }
    now_ = safe_;
    for (const auto& [sector, versions] : states) {
      const std::size_t pick = std::uniform_int_distribution<std::size_t>{0, versions.size()}(rng);
      if (pick < versions.size())
        std::ranges::copy(versions[pick],
                          now_.begin() + static_cast<std::ptrdiff_t>(sector * kSector));
    }
    come_back();
  }
  /// The power was away after exactly so many bytes of what was not safe, in order.
  void lose_power_after(std::size_t bytes) {
    now_ = safe_;
    for (const auto& [at, data] : writes_) {
      const std::size_t count = std::min(bytes, data.size());
      std::memcpy(now_.data() + at, data.data(), count);
      bytes -= count;
    }
    come_back();
  }
  [[nodiscard]] std::size_t unsafe_bytes() const {
    std::size_t sum = 0;
    for (const auto& [at, data] : writes_) sum += data.size();
    return sum;
  }
  [[nodiscard]] std::vector<std::byte>& bytes() { return now_; }

 private:
  void come_back() {
    safe_ = now_;
    writes_.clear();
    operations_left_ = kForEver;
  }

  static constexpr std::uint64_t kForEver = ~std::uint64_t{0};
  std::vector<std::byte> safe_;
  std::vector<std::byte> now_;
  std::vector<std::pair<std::uint64_t, std::vector<std::byte>>> writes_;  ///< not safe yet
  std::uint64_t operations_left_ = kForEver;
};

/// Everything that a store hands over.
struct Contents final : journal::Visitor {
  std::vector<DeltaPoseRecord> deltas;
  std::vector<RangeRecord> ranges;
  std::vector<MapletKey> maplets;
  std::vector<std::vector<std::byte>> maplet_bytes;
  std::vector<journal::Part> parts;
  std::vector<journal::Decision> decisions;
  std::vector<journal::NodePose> poses;

  void take(const DeltaPoseRecord& record) noexcept override { deltas.push_back(record); }
  void take(const RangeRecord& record) noexcept override { ranges.push_back(record); }
  void take(const MapletKey& key, float, std::span<const std::byte> bytes) noexcept override {
    maplets.push_back(key);
    maplet_bytes.emplace_back(bytes.begin(), bytes.end());
  }
  void take(const journal::Part& part) noexcept override { parts.push_back(part); }
  void take(const journal::Decision& decision) noexcept override { decisions.push_back(decision); }
  void take(const journal::Poses& piece) noexcept override {
    if (piece.first) poses.clear();
    poses.insert(poses.end(), piece.poses.begin(), piece.poses.end());
  }
};

/// A store, its buffers, and a turn to fill.
struct Journaled {
  explicit Journaled(journal::BlockFile& file) : store{file, scratch} {}

  static inline const Life kLife{3, 0xABCD1234};
  std::vector<std::byte> scratch = std::vector<std::byte>(2 * journal::kMaxTurnBytes);
  std::vector<std::byte> buffer = std::vector<std::byte>(journal::kMaxTurnBytes);
  journal::Store store;
  journal::TurnBuilder turn{buffer, kLife};
};

inline journal::Survey survey_of(journal::BlockFile& file) {
  std::vector<std::byte> buffer(journal::kMaxTurnBytes);
  return journal::Reader{file, buffer}.survey();
}

inline Contents contents_of(journal::BlockFile& file) {
  std::vector<std::byte> buffer(journal::kMaxTurnBytes);
  journal::Reader reader{file, buffer};
  Contents contents;
  const journal::Survey survey = reader.survey();
  reader.read(survey, contents);
  return contents;
}

/// The delta-pose with this number; always the same one.
inline DeltaPoseRecord numbered_delta(std::uint32_t seq, Life life = Journaled::kLife) {
  std::mt19937 rng{seq};
  return *quantise(random_delta(rng, life.agent, life.epoch, seq), life.agent, life.epoch, seq);
}

/// Bytes that stand for a maplet; always the same ones.
inline std::vector<std::byte> numbered_maplet(std::uint32_t id) {
  std::mt19937 rng{id + 77};
  std::vector<std::byte> bytes(600 + rng() % 5000);
  for (std::byte& b : bytes) b = static_cast<std::byte>(rng());
  return bytes;
}

}  // namespace maplet::test
