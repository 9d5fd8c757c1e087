// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/crypto.hpp"

#include <openssl/core_names.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/kdf.h>
#include <openssl/rand.h>

#include <algorithm>
#include <cstdlib>
#include <type_traits>

namespace maplet {

namespace {

struct Free {
  void operator()(EVP_PKEY* p) const noexcept { EVP_PKEY_free(p); }
  void operator()(EVP_PKEY_CTX* p) const noexcept { EVP_PKEY_CTX_free(p); }
  void operator()(EVP_MD_CTX* p) const noexcept { EVP_MD_CTX_free(p); }
  void operator()(EVP_CIPHER* p) const noexcept { EVP_CIPHER_free(p); }
  void operator()(EVP_CIPHER_CTX* p) const noexcept { EVP_CIPHER_CTX_free(p); }
  void operator()(EVP_KDF* p) const noexcept { EVP_KDF_free(p); }
  void operator()(EVP_KDF_CTX* p) const noexcept { EVP_KDF_CTX_free(p); }
};
template <class T>
using Owned = std::unique_ptr<T, Free>;

/// A failure of the library itself.
void must(bool good) noexcept {
  if (!good) std::abort();
}

template <class Bytes>
auto* raw(Bytes&& bytes) noexcept {
  if constexpr (std::is_const_v<std::remove_reference_t<decltype(*bytes.data())>>) {
    return reinterpret_cast<const unsigned char*>(bytes.data());
  } else {
    return reinterpret_cast<unsigned char*>(bytes.data());
  }
}

Owned<EVP_PKEY> private_key(int type, const Secret<32>& key) noexcept {
  Owned<EVP_PKEY> made{EVP_PKEY_new_raw_private_key(type, nullptr, raw(key.bytes()), 32)};
  must(made != nullptr);
  return made;
}

std::array<std::byte, 32> public_part(const EVP_PKEY* key) noexcept {
  std::array<std::byte, 32> out{};
  std::size_t size = out.size();
  must(EVP_PKEY_get_raw_public_key(key, raw(out), &size) == 1);
  return out;
}

}  // namespace

void wipe(std::span<std::byte> bytes) noexcept { OPENSSL_cleanse(bytes.data(), bytes.size()); }

void fill_random(std::span<std::byte> out) noexcept {
  must(RAND_bytes(raw(out), static_cast<int>(out.size())) == 1);
}

void derive(std::span<std::byte> out, std::span<const std::byte> secret,
            std::span<const std::byte> salt, std::string_view purpose) noexcept {
  const Owned<EVP_KDF> kdf{EVP_KDF_fetch(nullptr, "HKDF", nullptr)};
  const Owned<EVP_KDF_CTX> context{EVP_KDF_CTX_new(kdf.get())};
  const auto octets = [](const char* name, const void* data, std::size_t size) {
    return OSSL_PARAM_construct_octet_string(name, const_cast<void*>(data), size);
  };
  char hash[] = "SHA256";
  const OSSL_PARAM parameters[] = {OSSL_PARAM_construct_utf8_string(OSSL_KDF_PARAM_DIGEST, hash, 0),
                                   octets(OSSL_KDF_PARAM_KEY, secret.data(), secret.size()),
                                   octets(OSSL_KDF_PARAM_SALT, salt.data(), salt.size()),
                                   octets(OSSL_KDF_PARAM_INFO, purpose.data(), purpose.size()),
                                   OSSL_PARAM_construct_end()};
  must(context != nullptr && EVP_KDF_derive(context.get(), raw(out), out.size(), parameters) == 1);
}

void digest(std::span<std::byte> out, std::span<const std::byte> bytes) noexcept {
  std::array<std::byte, 32> all{};
  must(EVP_Digest(bytes.data(), bytes.size(), raw(all), nullptr, EVP_sha256(), nullptr) == 1);
  std::copy_n(all.begin(), std::min(out.size(), all.size()), out.begin());
}

VerifyingKey verifying_key(const SigningKey& key) noexcept {
  return public_part(private_key(EVP_PKEY_ED25519, key).get());
}

Signature sign(const SigningKey& key, std::span<const std::byte> message) noexcept {
  const auto pkey = private_key(EVP_PKEY_ED25519, key);
  const Owned<EVP_MD_CTX> context{EVP_MD_CTX_new()};
  Signature out{};
  std::size_t size = out.size();
  must(context != nullptr &&
       EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, pkey.get()) == 1 &&
       EVP_DigestSign(context.get(), raw(out), &size, raw(message), message.size()) == 1);
  return out;
}

bool verify(const VerifyingKey& key, std::span<const std::byte> message,
            const Signature& signature) noexcept {
  const Owned<EVP_PKEY> pkey{
      EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr, raw(key), key.size())};
  const Owned<EVP_MD_CTX> context{EVP_MD_CTX_new()};
  return pkey && context &&
         EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, pkey.get()) == 1 &&
         EVP_DigestVerify(context.get(), raw(signature), signature.size(), raw(message),
                          message.size()) == 1;
}

ExchangePublic exchange_public(const ExchangeKey& key) noexcept {
  return public_part(private_key(EVP_PKEY_X25519, key).get());
}

std::optional<Secret<32>> shared_secret(const ExchangeKey& key,
                                        const ExchangePublic& other) noexcept {
  const auto mine = private_key(EVP_PKEY_X25519, key);
  const Owned<EVP_PKEY> theirs{
      EVP_PKEY_new_raw_public_key(EVP_PKEY_X25519, nullptr, raw(other), other.size())};
  const Owned<EVP_PKEY_CTX> context{EVP_PKEY_CTX_new(mine.get(), nullptr)};
  Secret<32> shared;
  std::size_t size = 32;
  if (!theirs || !context || EVP_PKEY_derive_init(context.get()) != 1 ||
      EVP_PKEY_derive_set_peer(context.get(), theirs.get()) != 1 ||
      EVP_PKEY_derive(context.get(), raw(shared.bytes()), &size) != 1) {
    return {};
  }
  return shared;
}

struct Aead::Contexts {
  Owned<EVP_CIPHER> cipher{EVP_CIPHER_fetch(nullptr, "AES-128-CCM", nullptr)};
  Owned<EVP_CIPHER_CTX> out{EVP_CIPHER_CTX_new()};
  Owned<EVP_CIPHER_CTX> in{EVP_CIPHER_CTX_new()};
};

Aead::Aead() noexcept : contexts_{std::make_unique<Contexts>()} {
  must(contexts_->cipher && contexts_->out && contexts_->in);
}
Aead::~Aead() = default;

void Aead::set_key(const Key& key) noexcept {
  EVP_CIPHER_CTX* out = contexts_->out.get();
  EVP_CIPHER_CTX* in = contexts_->in.get();
  std::array<std::byte, kTagBytes> any{};
  must(EVP_EncryptInit_ex(out, contexts_->cipher.get(), nullptr, nullptr, nullptr) == 1 &&
       EVP_CIPHER_CTX_ctrl(out, EVP_CTRL_AEAD_SET_IVLEN, kNonceBytes, nullptr) == 1 &&
       EVP_CIPHER_CTX_ctrl(out, EVP_CTRL_AEAD_SET_TAG, kTagBytes, nullptr) == 1 &&
       EVP_EncryptInit_ex(out, nullptr, nullptr, raw(key.bytes()), nullptr) == 1);
  must(EVP_DecryptInit_ex(in, contexts_->cipher.get(), nullptr, nullptr, nullptr) == 1 &&
       EVP_CIPHER_CTX_ctrl(in, EVP_CTRL_AEAD_SET_IVLEN, kNonceBytes, nullptr) == 1 &&
       EVP_CIPHER_CTX_ctrl(in, EVP_CTRL_AEAD_SET_TAG, kTagBytes, any.data()) == 1 &&
       EVP_DecryptInit_ex(in, nullptr, nullptr, raw(key.bytes()), nullptr) == 1);
}

void Aead::seal(const Nonce& nonce, std::span<const std::byte> head,
                std::span<const std::byte> text, std::span<std::byte> out) noexcept {
  EVP_CIPHER_CTX* context = contexts_->out.get();
  int size = 0;
  must(EVP_EncryptInit_ex(context, nullptr, nullptr, nullptr, raw(nonce)) == 1 &&
       EVP_EncryptUpdate(context, nullptr, &size, nullptr, static_cast<int>(text.size())) == 1 &&
       EVP_EncryptUpdate(context, nullptr, &size, raw(head), static_cast<int>(head.size())) == 1 &&
       EVP_EncryptUpdate(context, raw(out), &size, raw(text), static_cast<int>(text.size())) == 1 &&
       EVP_EncryptFinal_ex(context, raw(out) + text.size(), &size) == 1 &&
       EVP_CIPHER_CTX_ctrl(context, EVP_CTRL_AEAD_GET_TAG, kTagBytes, out.data() + text.size()) ==
           1);
}

bool Aead::open(const Nonce& nonce, std::span<const std::byte> head,
                std::span<const std::byte> sealed, std::span<std::byte> out) noexcept {
  if (sealed.size() <= kTagBytes) return false;  // CCM here never seals nothing
  const auto text = sealed.first(sealed.size() - kTagBytes);
  const auto tag = sealed.last(kTagBytes);
  EVP_CIPHER_CTX* context = contexts_->in.get();
  int size = 0;
  must(EVP_CIPHER_CTX_ctrl(context, EVP_CTRL_AEAD_SET_TAG, kTagBytes,
                           const_cast<std::byte*>(tag.data())) == 1 &&
       EVP_DecryptInit_ex(context, nullptr, nullptr, nullptr, raw(nonce)) == 1 &&
       EVP_DecryptUpdate(context, nullptr, &size, nullptr, static_cast<int>(text.size())) == 1 &&
       EVP_DecryptUpdate(context, nullptr, &size, raw(head), static_cast<int>(head.size())) == 1);
  const bool good =
      EVP_DecryptUpdate(context, raw(out), &size, raw(text), static_cast<int>(text.size())) == 1;
  return good && size == static_cast<int>(text.size());
}

}  // namespace maplet
