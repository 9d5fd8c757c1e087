// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/key_files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/bio.h>
#include <openssl/pem.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>

namespace maplet {

namespace {

constexpr const char* kKeysLabel = "MAPLET AGENT KEYS";
constexpr const char* kNoticeLabel = "MAPLET KEY NOTICE";
constexpr std::size_t kMostBytes = std::size_t{1} << 17;

struct Close {
  int fd;
  ~Close() {
    if (fd >= 0) close(fd);
  }
};

tl::unexpected<std::string> fail_of(std::string what) {
  return tl::unexpected<std::string>{std::move(what)};
}

std::string whose(const std::string& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0) return {};
  return fmt::format(" (of {}, mode {:04o}; this is {})", user_name(info.st_uid),
                     info.st_mode & 07777, user_name(geteuid()));
}

tl::expected<std::string, std::string> read_all(const std::string& path, bool secret) {
  const Close file{open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (file.fd < 0) {
    const int error = errno;
    return fail_of(fmt::format(
        "{}: {}{}{}", path, std::strerror(error), error == ENOENT ? "" : whose(path),
        error == EACCES ? fmt::format(": chown {} it, and its folder", user_name(geteuid())) : ""));
  }
  struct stat info {};
  if (fstat(file.fd, &info) != 0 || !S_ISREG(info.st_mode)) {
    return fail_of(path + ": is no file");
  }
  if (secret && (info.st_mode & 077) != 0) {
    return fail_of(fmt::format("{0}: others may read it (mode {1:04o}): chmod 600 {0}", path,
                               info.st_mode & 07777));
  }
  if (secret && info.st_uid != geteuid() && info.st_uid != 0) {
    return fail_of(fmt::format("{0}: belongs to {1}, who may change it: chown {2} {0}", path,
                               user_name(info.st_uid), user_name(geteuid())));
  }
  std::string text(kMostBytes, '\0');
  std::size_t size = 0;
  for (ssize_t got = 1; got > 0 && size < text.size(); size += static_cast<std::size_t>(got)) {
    got = read(file.fd, text.data() + size, text.size() - size);
    if (got < 0) return fail_of(path + ": " + std::strerror(errno));
  }
  if (size == text.size()) return fail_of(path + ": is too large for keys");
  text.resize(size);
  return text;
}

struct FreeBio {
  void operator()(BIO* bio) const noexcept { BIO_free_all(bio); }
};

std::string armoured(const char* label, std::span<const std::byte> bytes) {
  const std::unique_ptr<BIO, FreeBio> bio{BIO_new(BIO_s_mem())};
  if (PEM_write_bio(bio.get(), label, "", reinterpret_cast<const unsigned char*>(bytes.data()),
                    static_cast<long>(bytes.size())) <= 0) {
    return {};
  }
  char* text = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &text);
  return {text, static_cast<std::size_t>(size)};
}

/// The blocks of one label in a text.
std::vector<Bytes> blocks(const std::string& text, std::string_view wanted) {
  std::vector<Bytes> found;
  const std::unique_ptr<BIO, FreeBio> bio{
      BIO_new_mem_buf(text.data(), static_cast<int>(text.size()))};
  char* label = nullptr;
  char* header = nullptr;
  unsigned char* data = nullptr;
  long size = 0;
  while (PEM_read_bio(bio.get(), &label, &header, &data, &size) == 1) {
    const std::span bytes{reinterpret_cast<const std::byte*>(data), static_cast<std::size_t>(size)};
    if (wanted == label) found.emplace_back(bytes.begin(), bytes.end());
    OPENSSL_free(label);
    OPENSSL_free(header);
    OPENSSL_clear_free(data, static_cast<std::size_t>(size));
  }
  return found;
}

/// A rename is on disk when its folder is. Where that cannot be done the file itself still is.
void flush_folder_of(const std::string& path) {
  const auto slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const Close at{open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (at.fd >= 0) (void)fsync(at.fd);
}

}  // namespace

std::string user_name(unsigned uid) {
  const passwd* user = getpwuid(uid);
  return user != nullptr ? user->pw_name : fmt::format("user {}", uid);
}

tl::expected<std::string, std::string> read_private(const std::string& path) {
  return read_all(path, true);
}

tl::expected<std::string, std::string> read_public(const std::string& path) {
  return read_all(path, false);
}

std::string write_file(const std::string& path, std::string_view text, int mode) {
  const std::string beside = path + ".new";
  (void)unlink(beside.c_str());
  const auto problem = [&] {
    const std::string what = fmt::format("{}: {}", path, std::strerror(errno));
    (void)unlink(beside.c_str());
    return what;
  };
  {
    const Close file{open(beside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode)};
    if (file.fd < 0 || fchmod(file.fd, static_cast<mode_t>(mode)) != 0) return problem();
    for (std::string_view rest = text; !rest.empty();) {
      const ssize_t done = write(file.fd, rest.data(), rest.size());
      if (done <= 0) return problem();
      rest.remove_prefix(static_cast<std::size_t>(done));
    }
    if (fsync(file.fd) != 0) return problem();
  }
  if (std::rename(beside.c_str(), path.c_str()) != 0) return problem();
  flush_folder_of(path);
  return {};
}

tl::expected<AgentKeys, std::string> load_agent_keys(const std::string& dir) {
  const std::string path = dir + "/" + kAgentKeysFile;
  auto text = read_private(path);
  if (!text && access(path.c_str(), F_OK) != 0 && errno == ENOENT) {
    return fail_of(path + ": is not there: mapletctl keys agent N writes it, for robot N");
  }
  if (!text) return fail_of(std::move(text.error()));
  const auto found = blocks(*text, kKeysLabel);
  wipe(std::as_writable_bytes(std::span{*text}));
  if (found.size() != 1) {
    return fail_of(path + ": truncated, or no agent's keys: mapletctl keys agent writes them");
  }
  auto keys = read_agent_keys(found.front());
  if (!keys) return fail_of(fmt::format("{}: {}", path, keys.error()));
  return std::move(*keys);
}

std::string agent_keys_text(const AgentKeys& keys, const SigningKey& signer) {
  return armoured(kKeysLabel, to_bytes(keys, signer));
}

std::vector<Bytes> notices_in(const std::string& text) { return blocks(text, kNoticeLabel); }

std::size_t notices_begun(const std::string& text) {
  const std::string begin = fmt::format("-----BEGIN {}", kNoticeLabel);
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find(begin, at)) != std::string::npos; ++at) ++count;
  return count;
}

std::string notice_text(std::span<const std::byte> notice) {
  return armoured(kNoticeLabel, notice);
}

}  // namespace maplet
