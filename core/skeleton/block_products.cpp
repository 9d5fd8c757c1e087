// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Products of two blocks, for AVX where the processor has it. Every variant adds the same numbers
// in the same order, without fused multiply-add: the results are the same bits on every machine.
#include "core/skeleton/block_kernels.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace maplet::block {
namespace {

#if defined(__x86_64__)

#define MAPLET_AVX __attribute__((target("avx")))

// Columns of three are loaded as four: the fourth lane is the next column's, and is stored over.
template <bool kSubtract>
MAPLET_AVX void product3(double* c, const double* a, const double* b) noexcept {
  __m256d c0 = _mm256_loadu_pd(c), c1 = _mm256_loadu_pd(c + 3), c2 = _mm256_loadu_pd(c + 6);
  for (int k = 0; k < 3; ++k) {
    const __m256d column = _mm256_loadu_pd(a + 3 * k);
    const __m256d p0 = _mm256_mul_pd(column, _mm256_broadcast_sd(b + 3 * k));
    const __m256d p1 = _mm256_mul_pd(column, _mm256_broadcast_sd(b + 3 * k + 1));
    const __m256d p2 = _mm256_mul_pd(column, _mm256_broadcast_sd(b + 3 * k + 2));
    c0 = kSubtract ? _mm256_sub_pd(c0, p0) : _mm256_add_pd(c0, p0);
    c1 = kSubtract ? _mm256_sub_pd(c1, p1) : _mm256_add_pd(c1, p1);
    c2 = kSubtract ? _mm256_sub_pd(c2, p2) : _mm256_add_pd(c2, p2);
  }
  _mm256_storeu_pd(c, c0);
  _mm256_storeu_pd(c + 3, c1);
  _mm_storeu_pd(c + 6, _mm256_castpd256_pd128(c2));
  _mm_store_sd(c + 8, _mm256_extractf128_pd(c2, 1));
}

// Two columns of six are three vectors: rows 0-3 | 4, 5 and the next one's 0, 1 | its 2-5.
template <bool kSubtract>
MAPLET_AVX void product6(double* c, const double* a, const double* b) noexcept {
  for (int j = 0; j < 6; j += 2) {
    double* to = c + 6 * j;
    __m256d c0 = _mm256_loadu_pd(to), c1 = _mm256_loadu_pd(to + 4), c2 = _mm256_loadu_pd(to + 8);
    for (int k = 0; k < 6; ++k) {
      const __m256d a0 = _mm256_loadu_pd(a + 6 * k);
      const __m256d a2 = _mm256_loadu_pd(a + 6 * k + 2);
      const __m256d a1 = _mm256_permute2f128_pd(a2, a0, 0x21);
      const __m256d left = _mm256_broadcast_sd(b + 6 * k + j);
      const __m256d right = _mm256_broadcast_sd(b + 6 * k + j + 1);
      const __m256d p0 = _mm256_mul_pd(a0, left);
      const __m256d p1 = _mm256_mul_pd(a1, _mm256_blend_pd(left, right, 0b1100));
      const __m256d p2 = _mm256_mul_pd(a2, right);
      c0 = kSubtract ? _mm256_sub_pd(c0, p0) : _mm256_add_pd(c0, p0);
      c1 = kSubtract ? _mm256_sub_pd(c1, p1) : _mm256_add_pd(c1, p1);
      c2 = kSubtract ? _mm256_sub_pd(c2, p2) : _mm256_add_pd(c2, p2);
    }
    _mm256_storeu_pd(to, c0);
    _mm256_storeu_pd(to + 4, c1);
    _mm256_storeu_pd(to + 8, c2);
  }
}

bool has_avx() noexcept { return __builtin_cpu_supports("avx") != 0; }

#endif

template <int D, bool kSubtract>
Product choose() noexcept {
#if defined(__x86_64__)
  if (has_avx()) return D == 3 ? product3<kSubtract> : product6<kSubtract>;
#endif
  return portable_product<D, kSubtract>;
}

}  // namespace

const Product add_product_3 = choose<3, false>();
const Product add_product_6 = choose<6, false>();
const Product subtract_product_3 = choose<3, true>();
const Product subtract_product_6 = choose<6, true>();

}  // namespace maplet::block
