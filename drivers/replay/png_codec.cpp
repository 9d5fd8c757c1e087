// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/png_codec.hpp"

#include <png.h>

#include <algorithm>
#include <bit>
#include <csetjmp>
#include <cstring>

#include "core/limits.hpp"

// Functions that call setjmp hold only plain values whose destructors do nothing: a longjmp over
// anything else is undefined.

namespace maplet::png {

namespace {

// inflate's window and state (43 kB), libpng's own structs, palette, three rows of 16-bit RGBA.
constexpr std::size_t kPoolBytes = std::size_t{192} * 1024 + 4 * kMaxWidthPx * 8;

struct Input {
  const std::byte* next;
  std::size_t left;
};

struct Reading {
  png_structp png = nullptr;
  png_infop info = nullptr;
  Input input{};
};

void remember(Reason& why, const char* text) noexcept {
  std::snprintf(why.data(), why.size(), "%s", text);
}

[[noreturn]] void on_error(png_structp png, png_const_charp text) {
  remember(*static_cast<Reason*>(png_get_error_ptr(png)), text);
  png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

png_voidp pool_take(png_structp png, png_alloc_size_t bytes) {
  return static_cast<Pool*>(png_get_mem_ptr(png))->take(bytes);
}

void pool_give(png_structp, png_voidp) {}

void on_read(png_structp png, png_bytep to, std::size_t count) {
  auto& input = *static_cast<Input*>(png_get_io_ptr(png));
  if (count > input.left) png_error(png, "truncated");
  std::memcpy(to, input.next, count);
  input.next += count;
  input.left -= count;
}

/// Everything up to the first row of pixels.
bool begin(Reading& reading, Pool& pool, std::span<const std::byte> bytes, Reason& why) noexcept {
  pool.reset();
  remember(why, "out of memory");
  reading.input = {bytes.data(), bytes.size()};
  reading.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &why, on_error, on_warning, &pool,
                                         pool_take, pool_give);
  if (reading.png == nullptr) return false;
  if (setjmp(png_jmpbuf(reading.png))) return false;
  reading.info = png_create_info_struct(reading.png);
  if (reading.info == nullptr) return false;
  png_set_user_limits(reading.png, kMaxWidthPx, kMaxHeightPx);
  // Only what the pixels need: IHDR, PLTE, tRNS, IDAT, IEND.
  png_set_keep_unknown_chunks(reading.png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_set_read_fn(reading.png, &reading.input, on_read);
  png_read_info(reading.png, reading.info);
  return true;
}

void end(Reading& reading) noexcept {
  if (reading.png != nullptr) png_destroy_read_struct(&reading.png, &reading.info, nullptr);
}

/// The rows, straight into `pixels`; the end of the file is part of the image.
bool read_rows(Reading& reading, std::byte* pixels, std::size_t row_bytes) noexcept {
  if (setjmp(png_jmpbuf(reading.png))) return false;
  const int passes = png_set_interlace_handling(reading.png);
  png_read_update_info(reading.png, reading.info);
  if (png_get_rowbytes(reading.png, reading.info) != row_bytes) png_error(reading.png, "odd rows");
  const png_uint_32 rows = png_get_image_height(reading.png, reading.info);
  for (int pass = 0; pass < passes; ++pass) {
    for (png_uint_32 row = 0; row < rows; ++row) {
      png_read_row(reading.png, reinterpret_cast<png_bytep>(pixels + row * row_bytes), nullptr);
    }
  }
  png_read_end(reading.png, nullptr);
  return true;
}

/// Whatever the file holds becomes one 8-bit channel.
bool ask_for_gray(Reading& reading) noexcept {
  if (setjmp(png_jmpbuf(reading.png))) return false;
  constexpr png_fixed_point kRed = 29900, kGreen = 58700;  // of 100000: BT.601, as JPEG's luma
  png_set_expand(reading.png);
  png_set_scale_16(reading.png);
  png_set_strip_alpha(reading.png);
  if (png_get_color_type(reading.png, reading.info) & PNG_COLOR_MASK_COLOR) {
    png_set_rgb_to_gray_fixed(reading.png, PNG_ERROR_ACTION_NONE, kRed, kGreen);
  }
  return true;
}

}  // namespace

Pool::Pool() : bytes_{std::make_unique_for_overwrite<std::byte[]>(kPoolBytes)} {}

void* Pool::take(std::size_t bytes) noexcept {
  constexpr std::size_t kAlign = alignof(std::max_align_t);
  if (bytes > kPoolBytes) return nullptr;
  const std::size_t rounded = (bytes + kAlign - 1) / kAlign * kAlign;
  if (rounded > kPoolBytes - used_) return nullptr;
  void* place = bytes_.get() + used_;
  used_ += rounded;
  return place;
}

bool is_png(std::span<const std::byte> bytes) noexcept {
  constexpr std::size_t kSignature = 8;
  return bytes.size() >= kSignature &&
         png_sig_cmp(reinterpret_cast<png_const_bytep>(bytes.data()), 0, kSignature) == 0;
}

bool read_header(Pool& pool, std::span<const std::byte> bytes, Header& header,
                 Reason& why) noexcept {
  // libpng refuses large images in words of its own; the size is wanted for ours.
  constexpr std::size_t kSizeAt = 16;
  if (bytes.size() < kSizeAt + 8) {
    remember(why, "truncated");
    return false;
  }
  const auto* at = reinterpret_cast<png_const_bytep>(bytes.data()) + kSizeAt;
  header.width_px = png_get_uint_32(at);
  header.height_px = png_get_uint_32(at + 4);
  if (header.width_px > kMaxWidthPx || header.height_px > kMaxHeightPx) return true;
  Reading reading;
  const bool good = begin(reading, pool, bytes, why);
  if (good) {
    header.bits = png_get_bit_depth(reading.png, reading.info);
    header.gray = png_get_color_type(reading.png, reading.info) == PNG_COLOR_TYPE_GRAY;
  }
  end(reading);
  return good;
}

bool read_depth(Pool& pool, std::span<const std::byte> bytes, std::uint16_t* pixels,
                Reason& why) noexcept {
  Reading reading;
  bool good = begin(reading, pool, bytes, why);
  if (good) {
    const std::size_t width = png_get_image_width(reading.png, reading.info);
    if constexpr (std::endian::native == std::endian::little) png_set_swap(reading.png);
    good = read_rows(reading, reinterpret_cast<std::byte*>(pixels), width * sizeof *pixels);
  }
  end(reading);
  return good;
}

bool read_gray(Pool& pool, std::span<const std::byte> bytes, std::uint8_t* pixels,
               Reason& why) noexcept {
  Reading reading;
  bool good = begin(reading, pool, bytes, why) && ask_for_gray(reading);
  if (good) {
    const std::size_t width = png_get_image_width(reading.png, reading.info);
    good = read_rows(reading, reinterpret_cast<std::byte*>(pixels), width);
  }
  end(reading);
  return good;
}

bool write(std::FILE* file, int width_px, int height_px, int bits,
           std::span<const std::byte* const> rows, Reason& why) noexcept {
  remember(why, "out of memory");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &why, on_error, on_warning);
  if (png == nullptr) return false;
  png_infop info = png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png))) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_init_io(png, file);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width_px), static_cast<png_uint_32>(height_px),
               bits, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  // A fifth of libpng's default time: depth in steps repeats as it is, gray as differences.
  png_set_compression_level(png, bits == 16 ? 4 : 2);
  png_set_filter(png, PNG_FILTER_TYPE_BASE, bits == 16 ? PNG_FILTER_NONE : PNG_FILTER_SUB);
  png_write_info(png, info);
  if (bits == 16 && std::endian::native == std::endian::little) png_set_swap(png);
  for (const std::byte* row : rows) {
    png_write_row(png, reinterpret_cast<png_const_bytep>(row));
  }
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return true;
}

}  // namespace maplet::png
