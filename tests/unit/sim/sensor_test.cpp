// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The noise against the published figures.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <numeric>

#include "tests/unit/sim/sim_test.hpp"

namespace maplet {
namespace {

using test::Parameters;
using test::sim;

/// Residuals of inverse depth, 1/m, on a wall that fills the image; NaN where there is no depth.
struct Residuals {
  int width = 0;
  int height = 0;
  std::vector<double> values;

  [[nodiscard]] double at(int u, int v) const {
    return values[static_cast<std::size_t>(v * width + u)];
  }
  [[nodiscard]] double sd() const {
    double sum = 0.0;
    int count = 0;
    for (const double r : values) {
      if (std::isnan(r)) continue;
      sum += r * r;
      ++count;
    }
    return std::sqrt(sum / count);
  }
  /// Correlation of neighbours `du`, `dv` apart.
  [[nodiscard]] double correlation(int du, int dv) const {
    double sum = 0.0;
    int count = 0;
    for (int v = 0; v + dv < height; ++v) {
      for (int u = 0; u + du < width; ++u) {
        const double product = at(u, v) * at(u + du, v + dv);
        if (std::isnan(product)) continue;
        sum += product;
        ++count;
      }
    }
    return sum / count / (sd() * sd());
  }
};

Residuals residuals(SimSource& source) {
  const auto frame = source.next(Deadline::never());
  EXPECT_TRUE(frame);
  Residuals out{frame->depth.width_px, frame->depth.height_px, {}};
  for (std::size_t i = 0; i < source.labels().size(); ++i) {
    const std::uint16_t mm = frame->depth.pixels[i];
    out.values.push_back(mm == 0
                             ? std::nan("")
                             : 1000.0 / mm - static_cast<double>(source.exact_inverse_depth()[i]));
  }
  return out;
}

TEST(SimSensor, InverseDepthSpreadsByKhoshelhamsConstant) {
  for (const char* width : {"640", "320"}) {
    const auto source = sim("wall", {{"width", width}, {"gray", "0"}});
    const Residuals r = residuals(*source);
    EXPECT_NEAR(r.sd(), 1.425e-3, 0.03 * 1.425e-3);
    const double mean = std::accumulate(r.values.begin(), r.values.end(), 0.0) /
                        static_cast<double>(r.values.size());
    // Rounding of noise this small leaves up to 0.012 units of bias.
    EXPECT_NEAR(mean, 0.0, 6e-5);
  }
}

TEST(SimSensor, FrameTellsItsNoise) {
  for (const Parameters& parameters :
       {Parameters{{"noise", "1"}}, Parameters{{"noise", "2"}}, Parameters{{"handa", "1"}}}) {
    const auto source = sim("wall", parameters);
    const double told = source->next(Deadline::never())->noise.disparity_k;
    EXPECT_NEAR(residuals(*source).sd(), told, 0.06 * told);
  }
}

TEST(SimSensor, NeighboursShareNoiseAndDistantPixelsDoNot) {
  const auto source = sim("wall", {{"gray", "0"}});
  const Residuals r = residuals(*source);
  EXPECT_GT(r.correlation(1, 0), 0.2);
  EXPECT_GT(r.correlation(0, 1), 0.2);
  EXPECT_LT(std::abs(r.correlation(3, 0)), 0.03);
  EXPECT_LT(std::abs(r.correlation(0, 3)), 0.03);
}

/// What an estimator needs: planes fitted to patches spread as noise.correlated_px predicts.
TEST(SimSensor, FittedPlanesSpreadAsTheFrameTells) {
  const auto source = sim("wall", {{"gray", "0"}, {"frames", "4"}});
  constexpr int kSide = 24;
  double sum = 0.0;
  int count = 0;
  while (const auto frame = source->next(Deadline::never())) {
    const int width = frame->depth.width_px;
    for (int v0 = 0; v0 + kSide <= frame->depth.height_px; v0 += kSide) {
      for (int u0 = 0; u0 + kSide <= width; u0 += kSide) {
        Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
        Eigen::Vector3d b = Eigen::Vector3d::Zero();
        for (int v = v0; v < v0 + kSide; ++v) {
          for (int u = u0; u < u0 + kSide; ++u) {
            const Eigen::Vector3d m = frame->camera.ray(u, v);
            const double exact = static_cast<double>(source->exact_inverse_depth()[v * width + u]);
            A += m * m.transpose();
            b += m * (1000.0 / frame->depth.at(u, v) - exact);
          }
        }
        const double k = frame->noise.disparity_k;
        const Eigen::Vector3d error = A.ldlt().solve(b);
        sum += error.dot(A * error) / (k * k * frame->noise.correlated_px);
        count += 3;
      }
    }
  }
  EXPECT_NEAR(sum / count, 1.0, 0.25) << "normalised estimation error squared";
}

TEST(SimSensor, DepthComesInDisparitySteps) {
  const auto source = sim("corridor", {{"gray", "0"}, {"max_m", "8"}});
  const auto frame = source->next(Deadline::never());
  const double units_m = 8.0 * frame->camera.fx_px * 0.075;
  for (std::size_t i = 0; i < source->labels().size(); ++i) {
    const std::uint16_t mm = frame->depth.pixels[i];
    if (mm == 0) continue;
    const double step = std::round(units_m * 1000.0 / mm);
    ASSERT_NEAR(mm, units_m * 1000.0 / step, 0.51) << "no whole number of 1/8 px";
  }
}

TEST(SimSensor, DropsOutAtGrazingAnglesAndBeyondTheRange) {
  const auto source = sim("corridor", {{"gray", "0"}, {"max_m", "6"}, {"min_m", "0.8"}});
  const auto frame = source->next(Deadline::never());
  const Se3 T_camera_world = source->T_world_camera().se3.inverse();
  int steep = 0;
  int missed = 0;
  for (int v = 0; v < frame->depth.height_px; ++v) {
    for (int u = 0; u < frame->depth.width_px; ++u) {
      const int i = v * frame->depth.width_px + u;
      const std::uint16_t mm = frame->depth.pixels[i];
      ASSERT_LE(mm, 6000);
      const double z = 1.0 / static_cast<double>(source->exact_inverse_depth()[i]);
      ASSERT_TRUE(z < 6.6 || mm == 0) << z;
      if (z > 5.5 || z < 0.9) continue;
      const std::uint16_t id = source->labels()[static_cast<std::size_t>(i)];
      if (id == 0) {
        ++missed;
        continue;
      }
      const Plane plane = T_camera_world * source->planes()[id - std::size_t{1}];
      const double cosine = -plane.n.dot(frame->camera.ray(u, v).normalized());
      ASSERT_GT(cosine, 0.09);
      steep += cosine < 0.2 ? 1 : 0;
    }
  }
  EXPECT_GT(missed, 100);
  EXPECT_GT(steep, 100);
}

TEST(SimSensor, CastsTheProjectorsShadow) {
  const auto exact = sim("room", {{"noise", "0"}, {"gray", "0"}});
  const auto noisy = sim("room", {{"gray", "0"}});
  const auto full = sim("room", {{"dropout", "0"}, {"gray", "0"}});
  const auto valid = [](SimSource& source) {
    int count = 0;
    for (int i = 0; i < 5; ++i) {
      source.seek(static_cast<std::uint64_t>(i) * 80);
      (void)source.next(Deadline::never());
      for (const std::uint16_t id : source.labels()) count += id != 0 ? 1 : 0;
    }
    return count / 5.0 / (640 * 480);
  };
  EXPECT_GT(valid(*exact), 0.99);
  EXPECT_GT(valid(*full), 0.99);
  EXPECT_GT(valid(*noisy), 0.80);
  EXPECT_LT(valid(*noisy), 0.99);
}

}  // namespace
}  // namespace maplet
