// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>

/// Dense kernels on D x D blocks of doubles, column by column. Everything that the elimination
/// spends its time on; no allocation, no aliasing between arguments.
namespace maplet::block {

using Pair = double __attribute__((vector_size(16)));  // two doubles: SSE2 and NEON alike

inline Pair load(const double* p) noexcept {
  Pair v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline void store(double* p, Pair v) noexcept { std::memcpy(p, &v, sizeof v); }

/// c +- a b^T, on any processor.
template <int D, bool kSubtract>
void portable_product(double* c, const double* a, const double* b) noexcept {
  if constexpr (D == 6) {
    for (int j = 0; j < 6; j += 2) {
      Pair c0 = load(c + 6 * j), c1 = load(c + 6 * j + 2), c2 = load(c + 6 * j + 4);
      Pair c3 = load(c + 6 * j + 6), c4 = load(c + 6 * j + 8), c5 = load(c + 6 * j + 10);
      for (int k = 0; k < 6; ++k) {
        const Pair a0 = load(a + 6 * k), a1 = load(a + 6 * k + 2), a2 = load(a + 6 * k + 4);
        const double l = kSubtract ? -b[6 * k + j] : b[6 * k + j];
        const double r = kSubtract ? -b[6 * k + j + 1] : b[6 * k + j + 1];
        const Pair left = {l, l};
        const Pair right = {r, r};
        c0 += a0 * left, c1 += a1 * left, c2 += a2 * left;
        c3 += a0 * right, c4 += a1 * right, c5 += a2 * right;
      }
      store(c + 6 * j, c0), store(c + 6 * j + 2, c1), store(c + 6 * j + 4, c2);
      store(c + 6 * j + 6, c3), store(c + 6 * j + 8, c4), store(c + 6 * j + 10, c5);
    }
  } else {
    for (int j = 0; j < D; ++j)
      for (int k = 0; k < D; ++k) {
        const double factor = kSubtract ? -b[j + D * k] : b[j + D * k];
        for (int i = 0; i < D; ++i) c[i + D * j] += a[i + D * k] * factor;
      }
  }
}

/// c +- a b^T with the processor's best instructions. A block of 3 x 3 may be read one number
/// beyond its end: the pool keeps one in reserve.
using Product = void (*)(double* c, const double* a, const double* b) noexcept;
extern const Product add_product_3, add_product_6, subtract_product_3, subtract_product_6;

template <int D>
inline void add_product(double* c, const double* a, const double* b) noexcept {
  (D == 3 ? add_product_3 : add_product_6)(c, a, b);
}
template <int D>
inline void subtract_product(double* c, const double* a, const double* b) noexcept {
  (D == 3 ? subtract_product_3 : subtract_product_6)(c, a, b);
}

/// a = c c^T in place (upper part zeroed). @return false at a pivot that is not positive; a is
/// lost.
template <int D>
[[nodiscard]] inline bool cholesky(double* a) noexcept {
  for (int j = 0; j < D; ++j) {
    double d = a[j + D * j];
    const double whole = d;
    for (int k = 0; k < j; ++k) d -= a[j + D * k] * a[j + D * k];
    if (!(d > 1e-14 * std::abs(whole)) || !std::isfinite(d)) return false;
    const double root = std::sqrt(d);
    a[j + D * j] = root;
    for (int i = j + 1; i < D; ++i) {
      double v = a[i + D * j];
      for (int k = 0; k < j; ++k) v -= a[i + D * k] * a[j + D * k];
      a[i + D * j] = v / root;
      a[j + D * i] = 0.0;
    }
  }
  return true;
}

/// x = x c^-T, c lower triangular.
template <int D>
inline void solve_right(double* x, const double* c) noexcept {
  for (int j = 0; j < D; ++j) {
    const double inv = 1.0 / c[j + D * j];
    for (int i = 0; i < D; ++i) {
      double v = x[i + D * j];
      for (int k = 0; k < j; ++k) v -= x[i + D * k] * c[j + D * k];
      x[i + D * j] = v * inv;
    }
  }
}

/// y -= l x.
template <int D>
inline void subtract_times(double* y, const double* l, const double* x) noexcept {
  for (int k = 0; k < D; ++k)
    for (int i = 0; i < D; ++i) y[i] -= l[i + D * k] * x[k];
}

/// y -= l^T x.
template <int D>
inline void subtract_transposed_times(double* y, const double* l, const double* x) noexcept {
  for (int k = 0; k < D; ++k) {
    double sum = 0.0;
    for (int i = 0; i < D; ++i) sum += l[i + D * k] * x[i];
    y[k] -= sum;
  }
}

/// x = c^-1 x.
template <int D>
inline void solve_lower(const double* c, double* x) noexcept {
  double inverse[D];  // none waits for another
  for (int i = 0; i < D; ++i) inverse[i] = 1.0 / c[i + D * i];
  for (int i = 0; i < D; ++i) {
    double v = x[i];
    for (int k = 0; k < i; ++k) v -= c[i + D * k] * x[k];
    x[i] = v * inverse[i];
  }
}

/// x = c^-T x.
template <int D>
inline void solve_lower_transposed(const double* c, double* x) noexcept {
  double inverse[D];
  for (int i = 0; i < D; ++i) inverse[i] = 1.0 / c[i + D * i];
  for (int i = D - 1; i >= 0; --i) {
    double v = x[i];
    for (int k = i + 1; k < D; ++k) v -= c[k + D * i] * x[k];
    x[i] = v * inverse[i];
  }
}

}  // namespace maplet::block
