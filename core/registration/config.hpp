// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/field.hpp"

namespace maplet {

/// How maplets are aligned. Section [registration].
struct RegistrationConfig {
  double gate_m = 0.6;
  double gate_rad = 0.35;
  double link_gate_m = 0.15;
  double link_gate_rad = 0.1;
  int max_iterations = 20;
  int min_matches = 1;
  double min_extent_overlap = 0.15;
  double uneven_m = 0.008;
  double uneven_rad = 0.012;
  double free_sigma_m = 0.15;
  double search_m = 4.0;
  int accept_matches = 5;
  double accept_overlap = 0.2;
  double accept_chi2_per_dof = 2.0;
  double accept_conflict = 0.08;
  double accept_detail = 2.0;
  double accept_sigma_m = 0.025;
  double accept_sigma_rad = 0.0175;
  double reject_chi2_per_dof = 6.0;
  double reject_conflict = 0.3;

  static constexpr Field<RegistrationConfig> kFields[] = {
      {"gate_m", &RegistrationConfig::gate_m, 0.01, 5.0,
       "How far off a guess between any two maplets may be"},
      {"gate_rad", &RegistrationConfig::gate_rad, 0.01, 1.0,
       "How far turned a guess between any two maplets may be"},
      {"link_gate_m", &RegistrationConfig::link_gate_m, 0.01, 5.0,
       "How far off the odometry may be from one maplet to the next"},
      {"link_gate_rad", &RegistrationConfig::link_gate_rad, 0.01, 1.0,
       "How far turned the odometry may be from one maplet to the next"},
      {"max_iterations", &RegistrationConfig::max_iterations, 1, 100,
       "Rounds of matching and solving"},
      {"min_matches", &RegistrationConfig::min_matches, 1, 50,
       "With fewer pairs of planes there is no overlap"},
      {"min_extent_overlap", &RegistrationConfig::min_extent_overlap, 0.0, 1.0,
       "Share of the smaller plane that must lie on the larger one's extent"},
      {"uneven_m", &RegistrationConfig::uneven_m, 0.0, 0.5,
       "What real surfaces differ by from one view to another, beyond the planes' covariance"},
      {"uneven_rad", &RegistrationConfig::uneven_rad, 0.0, 0.5, "The same for their direction"},
      {"free_sigma_m", &RegistrationConfig::free_sigma_m, 0.001, 10.0,
       "A direction known worse than this counts as free"},
      {"search_m", &RegistrationConfig::search_m, 0.0, 100.0,
       "Closures are looked for among maplets whose origins are nearer; 0 looks for none"},
      {"accept_matches", &RegistrationConfig::accept_matches, 3, 50,
       "A closure needs this many pairs of planes"},
      {"accept_overlap", &RegistrationConfig::accept_overlap, 0.0, 1.0,
       "A closure needs this share of the smaller maplet's area on pairs"},
      {"accept_chi2_per_dof", &RegistrationConfig::accept_chi2_per_dof, 0.1, 100.0,
       "A closure's planes must fit at least this well"},
      {"accept_conflict", &RegistrationConfig::accept_conflict, 0.0, 1.0,
       "Share of the planes looked for that one maplet may have looked through in a closure"},
      {"accept_detail", &RegistrationConfig::accept_detail, 0.0, 100.0,
       "Without a guess, planes below 1 m2 must agree too: sum of the roots of their areas, m"},
      {"accept_sigma_m", &RegistrationConfig::accept_sigma_m, 0.001, 10.0,
       "Without a guess, the position must be known as well: standard deviation in all, m"},
      {"accept_sigma_rad", &RegistrationConfig::accept_sigma_rad, 0.001, 3.0,
       "The same of the rotation"},
      {"reject_chi2_per_dof", &RegistrationConfig::reject_chi2_per_dof, 0.1, 1000.0,
       "Planes that fit worse show two places"},
      {"reject_conflict", &RegistrationConfig::reject_conflict, 0.0, 1.0,
       "With more planes looked through they are two places"},
  };
};

}  // namespace maplet
