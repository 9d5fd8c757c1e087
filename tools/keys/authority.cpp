// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/keys/authority.hpp"

#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <memory>
#include <stdexcept>

namespace maplet::keys {

namespace {

struct Free {
  void operator()(BIO* p) const noexcept { BIO_free_all(p); }
  void operator()(EVP_PKEY* p) const noexcept { EVP_PKEY_free(p); }
  void operator()(X509* p) const noexcept { X509_free(p); }
  void operator()(X509_CRL* p) const noexcept { X509_CRL_free(p); }
  void operator()(X509_REVOKED* p) const noexcept { X509_REVOKED_free(p); }
  void operator()(X509_EXTENSION* p) const noexcept { X509_EXTENSION_free(p); }
  void operator()(PKCS7* p) const noexcept { PKCS7_free(p); }
  void operator()(ASN1_STRING* p) const noexcept { ASN1_STRING_free(p); }  // times and numbers
};
template <class T>
using Owned = std::unique_ptr<T, Free>;

template <class T>
T* must(T* made, const char* what) {
  if (made != nullptr) return made;
  throw std::runtime_error{std::string{"certificates: "} + what + ": " +
                           ERR_error_string(ERR_get_error(), nullptr)};
}
void must(bool good, const char* what) { (void)must(good ? what : nullptr, what); }

Owned<BIO> empty_text() { return Owned<BIO>{must(BIO_new(BIO_s_mem()), "memory")}; }
Owned<BIO> reading(const std::string& text) {
  return Owned<BIO>{must(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), "memory")};
}
std::string text_of(BIO* bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio, &data);
  return {data, static_cast<std::size_t>(size)};
}

std::string pem_of(const X509* certificate) {
  const auto out = empty_text();
  must(PEM_write_bio_X509(out.get(), certificate) == 1, "writing a certificate");
  return text_of(out.get());
}
std::string pem_of(const EVP_PKEY* key) {
  const auto out = empty_text();
  must(PEM_write_bio_PrivateKey(out.get(), key, nullptr, nullptr, 0, nullptr, nullptr) == 1,
       "writing a key");
  return text_of(out.get());
}
Owned<X509> certificate_in(const std::string& pem) {
  return Owned<X509>{must(PEM_read_bio_X509(reading(pem).get(), nullptr, nullptr, nullptr),
                          "the authority's certificate")};
}
Owned<EVP_PKEY> key_in(const std::string& pem) {
  return Owned<EVP_PKEY>{
      must(PEM_read_bio_PrivateKey(reading(pem).get(), nullptr, nullptr, nullptr),
           "the authority's key")};
}

void extend(X509* certificate, X509* issuer, int id, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Owned<X509_EXTENSION> extension{
      must(X509V3_EXT_conf_nid(nullptr, &context, id, value), value)};
  must(X509_add_ext(certificate, extension.get(), -1) == 1, value);
}

/// A certificate with everything but extensions and signature.
Owned<X509> blank(const std::string& name, std::uint64_t serial, const Validity& validity,
                  EVP_PKEY* key) {
  Owned<X509> made{must(X509_new(), "memory")};
  must(X509_set_version(made.get(), X509_VERSION_3) == 1 &&
           ASN1_INTEGER_set_uint64(X509_get_serialNumber(made.get()), serial) == 1 &&
           ASN1_TIME_set(X509_getm_notBefore(made.get()),
                         static_cast<time_t>(validity.not_before_s)) != nullptr &&
           ASN1_TIME_set(X509_getm_notAfter(made.get()),
                         static_cast<time_t>(validity.not_after_s)) != nullptr &&
           X509_NAME_add_entry_by_txt(X509_get_subject_name(made.get()), "CN", MBSTRING_UTF8,
                                      reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1,
                                      0) == 1 &&
           X509_set_pubkey(made.get(), key) == 1,
       name.c_str());
  return made;
}

Owned<EVP_PKEY> new_key() { return Owned<EVP_PKEY>{must(EVP_EC_gen("P-256"), "making a key")}; }

}  // namespace

Authority Authority::make(const std::string& name, const Validity& validity) {
  const auto key = new_key();
  const auto made = blank(name, 1, validity, key.get());
  must(X509_set_issuer_name(made.get(), X509_get_subject_name(made.get())) == 1, "issuer");
  extend(made.get(), made.get(), NID_basic_constraints, "critical,CA:TRUE");
  // digitalSignature: it signs governance and permissions, too; Cyclone refuses them without it.
  extend(made.get(), made.get(), NID_key_usage, "critical,digitalSignature,keyCertSign,cRLSign");
  extend(made.get(), made.get(), NID_subject_key_identifier, "hash");
  must(X509_sign(made.get(), key.get(), EVP_sha256()) > 0, "signing");
  return Authority{{pem_of(made.get()), pem_of(key.get())}};
}

bool Authority::sound() const {
  try {
    const auto certificate = certificate_in(self_.certificate);
    const auto key = key_in(self_.private_key);
    const bool fits = X509_check_private_key(certificate.get(), key.get()) == 1;
    ERR_clear_error();
    return fits;
  } catch (const std::runtime_error&) {
    return false;
  }
}

Identity Authority::issue(const std::string& name, std::uint64_t serial,
                          const Validity& validity) const {
  const auto issuer = certificate_in(self_.certificate);
  const auto signer = key_in(self_.private_key);
  const auto key = new_key();
  const auto made = blank(name, serial, validity, key.get());
  must(X509_set_issuer_name(made.get(), X509_get_subject_name(issuer.get())) == 1, "issuer");
  extend(made.get(), issuer.get(), NID_basic_constraints, "critical,CA:FALSE");
  extend(made.get(), issuer.get(), NID_key_usage, "critical,digitalSignature");
  must(X509_sign(made.get(), signer.get(), EVP_sha256()) > 0, "signing");
  return {pem_of(made.get()), pem_of(key.get())};
}

std::string Authority::sign(const std::string& text) const {
  constexpr int kFlags = PKCS7_TEXT | PKCS7_DETACHED | PKCS7_STREAM;
  const auto certificate = certificate_in(self_.certificate);
  const auto key = key_in(self_.private_key);
  const auto in = reading(text);
  const Owned<PKCS7> made{
      must(PKCS7_sign(certificate.get(), key.get(), nullptr, in.get(), kFlags), "signing")};
  const auto out = empty_text();
  must(SMIME_write_PKCS7(out.get(), made.get(), in.get(), kFlags) == 1, "signing");
  return text_of(out.get());
}

std::string Authority::revoked(const std::vector<std::uint64_t>& serials,
                               const Validity& validity) const {
  const auto issuer = certificate_in(self_.certificate);
  const auto key = key_in(self_.private_key);
  const Owned<X509_CRL> list{must(X509_CRL_new(), "memory")};
  const Owned<ASN1_TIME> from{
      must(ASN1_TIME_set(nullptr, static_cast<time_t>(validity.not_before_s)), "time")};
  const Owned<ASN1_TIME> until{
      must(ASN1_TIME_set(nullptr, static_cast<time_t>(validity.not_after_s)), "time")};
  must(X509_CRL_set_version(list.get(), X509_CRL_VERSION_2) == 1 &&
           X509_CRL_set_issuer_name(list.get(), X509_get_subject_name(issuer.get())) == 1 &&
           X509_CRL_set1_lastUpdate(list.get(), from.get()) == 1 &&
           X509_CRL_set1_nextUpdate(list.get(), until.get()) == 1,
       "a revocation list");
  for (const std::uint64_t serial : serials) {
    const Owned<ASN1_INTEGER> number{must(ASN1_INTEGER_new(), "memory")};
    Owned<X509_REVOKED> one{must(X509_REVOKED_new(), "memory")};
    must(ASN1_INTEGER_set_uint64(number.get(), serial) == 1 &&
             X509_REVOKED_set_serialNumber(one.get(), number.get()) == 1 &&
             X509_REVOKED_set_revocationDate(one.get(), from.get()) == 1 &&
             X509_CRL_add0_revoked(list.get(), one.get()) == 1,
         "a revocation list");
    (void)one.release();
  }
  must(X509_CRL_sort(list.get()) == 1 && X509_CRL_sign(list.get(), key.get(), EVP_sha256()) > 0,
       "signing");
  const auto out = empty_text();
  must(PEM_write_bio_X509_CRL(out.get(), list.get()) == 1, "writing a revocation list");
  return text_of(out.get());
}

}  // namespace maplet::keys
