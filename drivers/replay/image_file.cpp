// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/image_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <turbojpeg.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <vector>

#include "core/limits.hpp"
#include "drivers/replay/png_codec.hpp"

namespace maplet {

namespace {

// Pixels that do not compress at all, four 8-bit channels, and room for headers.
constexpr std::size_t kMaxFileBytes = kMaxWidthPx * kMaxHeightPx * 4 + 65536;

template <class... Args>
tl::unexpected<ImageError> bad(ErrorCode code, fmt::format_string<Args...> text, Args&&... args) {
  return tl::unexpected<ImageError>{ImageError{code, line(text, std::forward<Args>(args)...)}};
}

struct JpegHandle {
  void operator()(void* handle) const noexcept { tjDestroy(handle); }
};

bool is_jpeg(std::span<const std::byte> bytes) noexcept {
  return bytes.size() >= 2 && bytes[0] == std::byte{0xff} && bytes[1] == std::byte{0xd8};
}

const unsigned char* data(std::span<const std::byte> bytes) noexcept {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

tl::expected<void, ImageError> check_size(ImageSize got, ImageSize want, std::string_view name) {
  if (got == want) return {};
  return bad(ErrorCode::kBadInput, "{}: image is {}x{}, expected {}x{}", name, got.width_px,
             got.height_px, want.width_px, want.height_px);
}

}  // namespace

struct ImageReader::State {
  std::unique_ptr<std::byte[]> file = std::make_unique_for_overwrite<std::byte[]>(kMaxFileBytes);
  png::Pool pool;
  png::Reason reason{};
  std::unique_ptr<void, JpegHandle> jpeg{tjInitDecompress()};

  Result<std::span<const std::byte>> load(const char* name) noexcept;
  Result<png::Header> png_header(std::span<const std::byte> bytes, std::string_view name) noexcept;
  Result<ImageSize> jpeg_size(std::span<const std::byte> bytes, std::string_view name) noexcept;
};

auto ImageReader::State::load(const char* name) noexcept -> Result<std::span<const std::byte>> {
  // O_NONBLOCK: a FIFO must not hang the reader; it means nothing for regular files.
  const int fd = open(name, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return bad(ErrorCode::kIo, "{}: {}", name, std::strerror(errno));
  struct stat info {};
  std::size_t size = 0;
  ssize_t got = fstat(fd, &info) == 0 && S_ISREG(info.st_mode) ? 1 : -1;
  if (got < 0) errno = S_ISDIR(info.st_mode) ? EISDIR : EINVAL;
  while (got > 0 && size < kMaxFileBytes) {
    got = read(fd, file.get() + size, kMaxFileBytes - size);
    if (got > 0) size += static_cast<std::size_t>(got);
  }
  const int error = errno;
  close(fd);
  if (got < 0) return bad(ErrorCode::kIo, "{}: {}", name, std::strerror(error));
  if (size == kMaxFileBytes) {
    return bad(ErrorCode::kBadInput, "{}: larger than {} bytes", name, kMaxFileBytes);
  }
  return std::span<const std::byte>{file.get(), size};
}

auto ImageReader::State::png_header(std::span<const std::byte> bytes,
                                    std::string_view name) noexcept -> Result<png::Header> {
  png::Header header;
  if (!png::read_header(pool, bytes, header, reason)) {
    return bad(ErrorCode::kBadInput, "{}: damaged PNG ({})", name, reason.data());
  }
  if (header.width_px > kMaxWidthPx || header.height_px > kMaxHeightPx) {
    return bad(ErrorCode::kBadInput, "{}: image is {}x{}, at most {}x{} are supported", name,
               header.width_px, header.height_px, kMaxWidthPx, kMaxHeightPx);
  }
  return header;
}

auto ImageReader::State::jpeg_size(std::span<const std::byte> bytes, std::string_view name) noexcept
    -> Result<ImageSize> {
  if (!jpeg) return bad(ErrorCode::kIo, "{}: no JPEG decoder", name);
  ImageSize size;
  int sampling = 0;
  int colours = 0;
  if (tjDecompressHeader3(jpeg.get(), data(bytes), bytes.size(), &size.width_px, &size.height_px,
                          &sampling, &colours) != 0) {
    return bad(ErrorCode::kBadInput, "{}: damaged JPEG ({})", name, tjGetErrorStr2(jpeg.get()));
  }
  if (size.width_px <= 0 || size.height_px <= 0) {  // tables and no image count as success
    return bad(ErrorCode::kBadInput, "{}: damaged JPEG (no image)", name);
  }
  if (size.width_px > static_cast<int>(kMaxWidthPx) ||
      size.height_px > static_cast<int>(kMaxHeightPx)) {
    return bad(ErrorCode::kBadInput, "{}: image is {}x{}, at most {}x{} are supported", name,
               size.width_px, size.height_px, kMaxWidthPx, kMaxHeightPx);
  }
  return size;
}

ImageReader::ImageReader() : state_{std::make_unique<State>()} {}
ImageReader::~ImageReader() = default;
ImageReader::ImageReader(ImageReader&&) noexcept = default;
ImageReader& ImageReader::operator=(ImageReader&&) noexcept = default;

auto ImageReader::decode_size(std::span<const std::byte> bytes, std::string_view name) noexcept
    -> Result<ImageSize> {
  if (is_jpeg(bytes)) return state_->jpeg_size(bytes, name);
  if (bytes.empty()) return bad(ErrorCode::kBadInput, "{}: empty file", name);
  if (!png::is_png(bytes)) return bad(ErrorCode::kBadInput, "{}: neither PNG nor JPEG", name);
  return state_->png_header(bytes, name).map([](const png::Header& header) {
    return ImageSize{static_cast<int>(header.width_px), static_cast<int>(header.height_px)};
  });
}

auto ImageReader::decode_depth(std::span<const std::byte> bytes, std::string_view name,
                               ImageSize size, std::span<std::uint16_t> pixels) noexcept
    -> Result<void> {
  if (bytes.empty()) return bad(ErrorCode::kBadInput, "{}: empty file", name);
  if (!png::is_png(bytes)) return bad(ErrorCode::kBadInput, "{}: not a PNG", name);
  const auto header = state_->png_header(bytes, name);
  if (!header) return tl::unexpected{header.error()};
  if (header->bits != 16 || !header->gray) {
    return bad(ErrorCode::kBadInput, "{}: {}-bit {} image, depth must be 16-bit gray", name,
               header->bits, header->gray ? "gray" : "colour");
  }
  const auto fits = check_size(
      {static_cast<int>(header->width_px), static_cast<int>(header->height_px)}, size, name);
  if (!fits) return fits;
  if (pixels.size() < size.pixels()) return bad(ErrorCode::kCapacity, "{}: no room", name);
  if (!png::read_depth(state_->pool, bytes, pixels.data(), state_->reason)) {
    return bad(ErrorCode::kBadInput, "{}: damaged PNG ({})", name, state_->reason.data());
  }
  return {};
}

auto ImageReader::decode_gray(std::span<const std::byte> bytes, std::string_view name,
                              ImageSize size, std::span<std::uint8_t> pixels) noexcept
    -> Result<void> {
  const auto found = decode_size(bytes, name);
  if (!found) return tl::unexpected{found.error()};
  const auto fits = check_size(*found, size, name);
  if (!fits) return fits;
  if (pixels.size() < size.pixels()) return bad(ErrorCode::kCapacity, "{}: no room", name);
  if (is_jpeg(bytes)) {
    if (tjDecompress2(state_->jpeg.get(), data(bytes), bytes.size(), pixels.data(), size.width_px,
                      0, size.height_px, TJPF_GRAY, 0) != 0) {
      return bad(ErrorCode::kBadInput, "{}: damaged JPEG ({})", name,
                 tjGetErrorStr2(state_->jpeg.get()));
    }
  } else if (!png::read_gray(state_->pool, bytes, pixels.data(), state_->reason)) {
    return bad(ErrorCode::kBadInput, "{}: damaged PNG ({})", name, state_->reason.data());
  }
  return {};
}

auto ImageReader::read_depth(const std::filesystem::path& file, ImageSize size,
                             std::span<std::uint16_t> pixels) noexcept -> Result<void> {
  const auto bytes = state_->load(file.c_str());
  if (!bytes) return tl::unexpected{bytes.error()};
  return decode_depth(*bytes, file.c_str(), size, pixels);
}

auto ImageReader::read_gray(const std::filesystem::path& file, ImageSize size,
                            std::span<std::uint8_t> pixels) noexcept -> Result<void> {
  const auto bytes = state_->load(file.c_str());
  if (!bytes) return tl::unexpected{bytes.error()};
  return decode_gray(*bytes, file.c_str(), size, pixels);
}

auto ImageReader::read_size(const std::filesystem::path& file) noexcept -> Result<ImageSize> {
  const auto bytes = state_->load(file.c_str());
  if (!bytes) return tl::unexpected{bytes.error()};
  return decode_size(*bytes, file.c_str());
}

namespace {

template <class Pixel>
tl::expected<void, ImageError> write_gray_png(const std::filesystem::path& path,
                                              const ImageView<Pixel>& image) {
  if (image.empty() || image.width_px <= 0 || image.height_px <= 0) {
    return bad(ErrorCode::kBadInput, "{}: nothing to write", path.c_str());
  }
  std::vector<const std::byte*> rows(static_cast<std::size_t>(image.height_px));
  for (int v = 0; v < image.height_px; ++v) {
    rows[static_cast<std::size_t>(v)] = reinterpret_cast<const std::byte*>(image.row(v));
  }
  std::FILE* file = std::fopen(path.c_str(), "wbe");
  if (file == nullptr) return bad(ErrorCode::kIo, "{}: {}", path.c_str(), std::strerror(errno));
  png::Reason reason{};
  const bool written = png::write(file, image.width_px, image.height_px,
                                  static_cast<int>(8 * sizeof(Pixel)), rows, reason);
  const bool closed = std::fclose(file) == 0;
  if (written && closed) return {};
  const int error = errno;
  std::remove(path.c_str());
  return bad(ErrorCode::kIo, "{}: {}", path.c_str(),
             written ? std::strerror(error) : reason.data());
}

}  // namespace

tl::expected<void, ImageError> write_png(const std::filesystem::path& file,
                                         const ImageView<std::uint16_t>& image) {
  return write_gray_png(file, image);
}

tl::expected<void, ImageError> write_png(const std::filesystem::path& file,
                                         const ImageView<std::uint8_t>& image) {
  return write_gray_png(file, image);
}

}  // namespace maplet
