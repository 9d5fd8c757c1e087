// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/flight/flight_file.hpp"

#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "core/base/crc.hpp"

namespace maplet::flight {

namespace fs = std::filesystem;

namespace {

constexpr std::uint32_t kMagic = 0x746C666D;  // "mflt"

struct Head {
  std::uint32_t magic = kMagic;
  std::uint32_t number = 0;
  std::uint32_t bytes = 0;
  std::uint32_t crc = 0;  ///< of the content
  std::uint32_t type = 0;
  std::uint32_t check = 0;  ///< CRC-32C of the five above
};
static_assert(sizeof(Head) == kBlockHeadBytes);

std::uint32_t check_of(const Head& head) {
  return crc32c(std::as_bytes(std::span{&head, 1}).first(20));
}

std::uint64_t aligned(std::uint64_t at) { return (at + kAlign - 1) / kAlign * kAlign; }

std::string why(const std::string& path) {
  return fmt::format("{}: {}", path, std::strerror(errno));
}

bool write_at(std::FILE* file, std::uint64_t at, Block type, std::uint32_t number,
              std::span<const std::byte> bytes) {
  Head head;
  head.number = number;
  head.bytes = static_cast<std::uint32_t>(bytes.size());
  head.crc = crc32c(bytes);
  head.type = static_cast<std::uint32_t>(type);
  head.check = check_of(head);
  return fseeko(file, static_cast<off_t>(at), SEEK_SET) == 0 &&
         std::fwrite(&head, sizeof head, 1, file) == 1 &&
         std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
}

enum class There : std::uint8_t { kNothing, kRecording, kSomethingElse };

/// An empty file counts as nothing.
There what_is_at(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return There::kNothing;
  if (!fs::is_regular_file(path, error)) return There::kSomethingElse;
  const File file{std::fopen(path.c_str(), "rbe")};
  std::uint32_t magic = 0;
  if (!file) return There::kSomethingElse;
  const std::size_t read = std::fread(&magic, 1, sizeof magic, file.get());
  if (read == 0) return There::kNothing;
  return read == sizeof magic && magic == kMagic ? There::kRecording : There::kSomethingElse;
}

std::string not_ours(const std::string& path) {
  return path + ": is there and is no flight recorder's file: it is not overwritten";
}

bool is_being_recorded(const std::string& path) {
  const File file{std::fopen(path.c_str(), "rbe")};
  return file && flock(fileno(file.get()), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

bool same_file(std::FILE* open, const std::string& path) {
  struct stat a {};
  struct stat b {};
  return fstat(fileno(open), &a) == 0 && stat(path.c_str(), &b) == 0 && a.st_dev == b.st_dev &&
         a.st_ino == b.st_ino;
}

}  // namespace

tl::expected<std::unique_ptr<RingWriter>, std::string> RingWriter::make(const std::string& path,
                                                                        std::uint64_t bytes) {
  const There there = what_is_at(path);
  if (there == There::kSomethingElse) return tl::unexpected{not_ours(path)};
  if (is_being_recorded(path)) {
    return tl::unexpected{path + ": another mapletd records into it: give each a file of its own"};
  }
  if (there == There::kRecording && std::rename(path.c_str(), (path + ".1").c_str()) != 0) {
    return tl::unexpected{why(path + ".1")};
  }
  auto writer = std::make_unique<RingWriter>();
  writer->file_.reset(std::fopen(path.c_str(), "wbe"));
  if (!writer->file_) return tl::unexpected{why(path)};
  (void)flock(fileno(writer->file_.get()), LOCK_EX | LOCK_NB);
  writer->path_ = path;
  writer->size_ = bytes;
  return writer;
}

bool RingWriter::put(Block type, std::span<const std::byte> bytes) {
  const std::uint64_t end = aligned(at_ + kBlockHeadBytes + bytes.size());
  if (end > size_) {
    if (first_ + end - at_ > size_) return false;  // larger than the ring
    at_ = first_;
  }
  if (!write_at(file_.get(), at_, type, next_, bytes)) return false;
  at_ = aligned(at_ + kBlockHeadBytes + bytes.size());
  if (next_++ == 0) first_ = at_;
  return true;
}

tl::expected<std::unique_ptr<RingReader>, std::string> RingWriter::reader() const {
  File file{std::fopen(fmt::format("/proc/self/fd/{}", fileno(file_.get())).c_str(), "rbe")};
  if (!file) return tl::unexpected{why(path_)};
  return RingReader::read(std::move(file), path_);
}

bool RingWriter::flush() { return std::fflush(file_.get()) == 0; }

tl::expected<std::unique_ptr<RingReader>, std::string> RingReader::open(const std::string& path) {
  File file{std::fopen(path.c_str(), "rbe")};
  if (!file) return tl::unexpected{why(path)};
  return read(std::move(file), path);
}

tl::expected<std::unique_ptr<RingReader>, std::string> RingReader::read(File opened,
                                                                        const std::string& path) {
  auto reader = std::make_unique<RingReader>();
  reader->file_ = std::move(opened);
  std::FILE* file = reader->file_.get();
  if (fseeko(file, 0, SEEK_END) != 0) return tl::unexpected{why(path)};
  const auto size = static_cast<std::uint64_t>(std::max<off_t>(ftello(file), 0));
  std::vector<std::pair<std::uint32_t, Entry>> found;
  for (std::uint64_t at = 0; at + kBlockHeadBytes <= size;) {
    Head head;
    if (fseeko(file, static_cast<off_t>(at), SEEK_SET) != 0 ||
        std::fread(&head, sizeof head, 1, file) != 1) {
      break;
    }
    const bool good = head.magic == kMagic && head.check == check_of(head) &&
                      head.bytes <= kMostBlockBytes && head.type <= 3;
    if (good) {
      found.push_back(
          {head.number,
           {static_cast<Block>(head.type), head.bytes, head.crc, at + kBlockHeadBytes}});
    }
    at += good ? aligned(kBlockHeadBytes + head.bytes) : kAlign;
  }
  std::ranges::stable_sort(found, {}, [](const auto& f) { return f.first; });
  if (found.empty() || found.front().first != 0 || found.front().second.type != Block::kHead)
    return tl::unexpected{path +
                          ": is no flight recorder's file; mapletctl recorder save makes one"};
  std::vector<std::byte> head;
  if (!reader->read(found.front().second, head))
    return tl::unexpected{path + ": its first block is damaged"};
  reader->head_.assign(reinterpret_cast<const char*>(head.data()), head.size());
  // The newest run of numbers without a gap.
  std::size_t from = found.size() - 1;
  while (from > 1 && found[from].first == found[from - 1].first + 1) --from;
  reader->complete_ = found.size() < 2 || (from == 1 && found[1].first == 1);
  for (std::size_t i = std::max<std::size_t>(from, 1); i < found.size(); ++i)
    reader->entries_.push_back(found[i].second);
  return reader;
}

bool RingReader::read(const Entry& entry, std::vector<std::byte>& out) {
  out.resize(entry.bytes);
  return fseeko(file_.get(), static_cast<off_t>(entry.at), SEEK_SET) == 0 &&
         std::fread(out.data(), 1, out.size(), file_.get()) == out.size() &&
         crc32c(out) == entry.crc;
}

std::string RingReader::save(const std::string& path) {
  if (same_file(file_.get(), path)) return path + ": is the recording itself; name another file";
  if (what_is_at(path) == There::kSomethingElse) return not_ours(path);
  const std::string beside = path + ".part";
  File out{std::fopen(beside.c_str(), "wbe")};
  if (!out) return why(beside);
  std::uint64_t at = 0;
  // One number is left out where something was overwritten.
  std::uint32_t number = 0;
  const auto put = [&](Block type, std::span<const std::byte> bytes) {
    const bool good = write_at(out.get(), at, type, number, bytes);
    at = aligned(at + kBlockHeadBytes + bytes.size());
    ++number;
    return good;
  };
  bool good = put(Block::kHead, std::as_bytes(std::span{head_}));
  if (!complete_) ++number;
  std::vector<std::byte> bytes;
  for (const Entry& entry : entries_) good = good && read(entry, bytes) && put(entry.type, bytes);
  good = good && std::fflush(out.get()) == 0;
  out.reset();
  if (good && std::rename(beside.c_str(), path.c_str()) == 0) return "";
  std::string problem = good ? why(path) : path + ": cannot be written, or damaged";
  std::remove(beside.c_str());
  return problem;
}

}  // namespace maplet::flight
