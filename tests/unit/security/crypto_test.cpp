// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/crypto.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace maplet {
namespace {

std::vector<std::byte> from_hex(std::string_view hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(static_cast<std::byte>(std::stoi(std::string{hex.substr(i, 2)}, nullptr, 16)));
  }
  return bytes;
}

template <class Array>
Array array_of(std::string_view hex) {
  Array out{};
  std::ranges::copy(from_hex(hex), std::begin(out));
  return out;
}

TEST(Crypto, DerivesAsRfc5869Says) {
  std::array<std::byte, 32> out{};
  std::string info;
  for (int i = 0xf0; i <= 0xf9; ++i) info.push_back(static_cast<char>(i));
  derive(out, from_hex("0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b"),
         from_hex("000102030405060708090a0b0c"), info);
  EXPECT_TRUE(std::ranges::equal(
      out, from_hex("3cb25f25faacd57a90434f64d0362f2a2d2d0a90cf1a5a4c5db02d56ecc4c5bf")));
}

TEST(Crypto, SharesAsRfc7748Says) {
  ExchangeKey alice;
  std::ranges::copy(from_hex("77076d0a7318a57d3c16c17251b26645"
                             "4c6a4b0ad2f2b3e3b8ad8a2f9d9d8cf0"),
                    alice.bytes().begin());
  ExchangeKey bob;
  fill_random(bob.bytes());
  const auto one = shared_secret(alice, exchange_public(bob));
  const auto other = shared_secret(bob, exchange_public(alice));
  ASSERT_TRUE(one && other);
  EXPECT_EQ(*one, *other);
  EXPECT_FALSE(shared_secret(bob, ExchangePublic{})) << "a point of small order shares nothing";
}

TEST(Crypto, SignsAsRfc8032Says) {
  SigningKey key;
  std::ranges::copy(from_hex("9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60"),
                    key.bytes().begin());
  const Signature signature = sign(key, {});
  EXPECT_EQ(
      verifying_key(key),
      array_of<VerifyingKey>("d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a"));
  EXPECT_EQ(signature,
            array_of<Signature>("e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555f"
                                "b8821590a33bacc61e39701cf9b46bd25bf5f0595bbe24655141438e7a100b"));
  EXPECT_TRUE(verify(verifying_key(key), {}, signature));
  EXPECT_FALSE(verify(verifying_key(key), from_hex("00"), signature));
}

TEST(Crypto, OpensWhatWasSealedAndNothingElse) {
  Aead aead;
  Aead::Key key;
  fill_random(key.bytes());
  aead.set_key(key);
  Aead::Nonce nonce{};
  const auto head = from_hex("a20102");
  for (const std::size_t size : {std::size_t{1}, std::size_t{60}, std::size_t{1000}}) {
    std::vector<std::byte> text(size, std::byte{7});
    std::vector<std::byte> sealed(size + Aead::kTagBytes);
    std::vector<std::byte> opened(size);
    aead.seal(nonce, head, text, sealed);
    ASSERT_TRUE(aead.open(nonce, head, sealed, opened));
    EXPECT_EQ(opened, text);
    for (const std::size_t at : {std::size_t{0}, size - 1, size, sealed.size() - 1}) {
      sealed[at] ^= std::byte{1};
      EXPECT_FALSE(aead.open(nonce, head, sealed, opened));
      sealed[at] ^= std::byte{1};
    }
    EXPECT_FALSE(aead.open(nonce, from_hex("a20103"), sealed, opened));
    EXPECT_FALSE(aead.open(nonce, head, std::span{sealed}.first(Aead::kTagBytes), opened));
    nonce[0] ^= std::byte{1};
    EXPECT_FALSE(aead.open(nonce, head, sealed, opened));
    nonce[0] ^= std::byte{1};
    EXPECT_TRUE(aead.open(nonce, head, sealed, opened)) << "a failure leaves nothing behind";
  }
}

}  // namespace
}  // namespace maplet
