// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "drivers/flight/depth_code.hpp"
#include "drivers/flight/flight_file.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

using namespace flight;

std::vector<std::byte> block(std::uint32_t number, std::size_t bytes) {
  std::vector<std::byte> out(bytes, static_cast<std::byte>(number));
  return out;
}

TEST(DepthCode, GivesBackEveryPixel) {
  std::mt19937 rng{1};
  for (int round = 0; round < 50; ++round) {
    std::vector<std::uint16_t> pixels(1 + rng() % 3000);
    std::uint16_t z = 0;
    for (auto& p : pixels) {
      const auto dice = rng() % 20;
      z = dice == 0   ? std::uint16_t{0}
          : dice == 1 ? static_cast<std::uint16_t>(rng())
                      : static_cast<std::uint16_t>(z + rng() % 5 - 2);
      p = z;
    }
    std::vector<std::byte> code;
    encode_depth(pixels, code);
    std::vector<std::uint16_t> back(pixels.size());
    ASSERT_TRUE(decode_depth(code, back));
    ASSERT_EQ(back, pixels);
  }
}

TEST(DepthCode, AnyBytesAreSafe) {
  std::mt19937 rng{2};
  for (int round = 0; round < 2000; ++round) {
    std::vector<std::byte> bytes(rng() % 200);
    for (auto& b : bytes) b = static_cast<std::byte>(rng());
    std::vector<std::uint16_t> out(1 + rng() % 300);
    (void)decode_depth(bytes, out);
  }
}

TEST(FlightFile, TheNewestBlocksStay) {
  const TempDir folder;
  const std::string path = (folder.path() / "ring").string();
  {
    auto ring = RingWriter::make(path, 64 * 1024);
    ASSERT_TRUE(ring);
    ASSERT_TRUE((*ring)->put(Block::kHead, block(0, 100)));
    for (std::uint32_t i = 1; i < 200; ++i)
      ASSERT_TRUE((*ring)->put(Block::kEvents, block(i, 500 + i * 7)));
    ASSERT_FALSE((*ring)->put(Block::kEvents, block(0, 70'000)));
    ASSERT_TRUE((*ring)->flush());
  }
  auto reader = RingReader::open(path);
  ASSERT_TRUE(reader);
  EXPECT_FALSE((*reader)->complete());
  EXPECT_EQ((*reader)->head(), std::string(100, '\0'));
  std::vector<std::byte> bytes;
  std::size_t count = 0;
  std::uint32_t last = 0;
  while (const auto* entry = (*reader)->next()) {
    ASSERT_TRUE((*reader)->read(*entry, bytes));
    const auto number = std::to_integer<std::uint32_t>(bytes[0]);
    if (count++ > 0) {
      ASSERT_EQ(number, last + 1);
    }
    last = number;
  }
  EXPECT_EQ(last, 199U);
  EXPECT_GT(count, 20U);
  const std::string saved = (folder.path() / "saved").string();
  EXPECT_EQ((*reader)->save(saved), "");
  auto again = RingReader::open(saved);
  ASSERT_TRUE(again);
  EXPECT_FALSE((*again)->complete());
}

TEST(FlightFile, TwoDoNotRecordIntoOneAndEachSavesItsOwn) {
  const TempDir folder;
  const std::string path = (folder.path() / "ring").string();
  auto first = RingWriter::make(path, 1 << 20);
  ASSERT_TRUE(first);
  ASSERT_TRUE((*first)->put(Block::kHead, block(0, 10)));
  ASSERT_TRUE((*first)->flush());
  const auto second = RingWriter::make(path, 1 << 20);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().find("another mapletd"), std::string::npos);
  // Somebody moves it and puts another there: what is recorded is still saved.
  std::filesystem::rename(path, path + ".away");
  auto other = RingWriter::make(path, 1 << 20);
  ASSERT_TRUE(other);
  ASSERT_TRUE((*other)->put(Block::kHead, block(0, 20)));
  ASSERT_TRUE((*other)->flush());
  auto reader = (*first)->reader();
  ASSERT_TRUE(reader) << reader.error();
  EXPECT_EQ((*reader)->head().size(), 10U);
}

TEST(FlightFile, NothingElseIsOverwrittenAndTheLastRunStays) {
  const TempDir folder;
  const std::string path = (folder.path() / "ring").string();
  const auto record = [&](std::size_t bytes) {
    auto ring = RingWriter::make(path, 1 << 20);
    ASSERT_TRUE(ring) << ring.error();
    ASSERT_TRUE((*ring)->put(Block::kHead, block(0, bytes)));
  };
  record(10);
  record(20);
  EXPECT_EQ((*RingReader::open(path + ".1"))->head().size(), 10U);
  auto reader = RingReader::open(path);
  ASSERT_TRUE(reader);
  EXPECT_EQ((*reader)->head().size(), 20U);
  EXPECT_NE((*reader)->save(path).find("the recording itself"), std::string::npos);
  const std::string journal = (folder.path() / "mission.journal").string();
  std::ofstream{journal} << "precious";
  EXPECT_NE((*reader)->save(journal).find("not overwritten"), std::string::npos);
  EXPECT_FALSE(RingWriter::make(journal, 1 << 20));
  EXPECT_EQ(std::filesystem::file_size(journal), 8U);
  EXPECT_EQ((*reader)->save(path + ".1"), "");
  EXPECT_EQ((*RingReader::open(path + ".1"))->head().size(), 20U);
  EXPECT_FALSE(std::filesystem::exists(path + ".1.part"));
}

TEST(FlightFile, AWholeRunIsComplete) {
  const TempDir folder;
  const std::string path = (folder.path() / "ring").string();
  {
    auto ring = RingWriter::make(path, 1 << 20);
    ASSERT_TRUE((*ring)->put(Block::kHead, block(0, 10)));
    ASSERT_TRUE((*ring)->put(Block::kEvents, block(1, 10)));
    ASSERT_TRUE((*ring)->put(Block::kDepth, block(2, 10)));
  }
  auto reader = RingReader::open(path);
  ASSERT_TRUE(reader);
  EXPECT_TRUE((*reader)->complete());
}

TEST(FlightFile, RubbishIsRefused) {
  const TempDir folder;
  EXPECT_FALSE(RingReader::open((folder.path() / "none").string()));
}

}  // namespace
}  // namespace maplet::test
