// An MPC's side of the identifier in C++: which tires to drive on, and with how much grip. Needs the messages alone; tire_subscriber.cpp is a node around it.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <gripsight_msgs/msg/grip.hpp>
#include <gripsight_msgs/msg/pacejka_params.hpp>

class Tires {
 public:
  using Set = gripsight_msgs::msg::PacejkaParams;
  using Grip = gripsight_msgs::msg::Grip;

  // Sets of a car with other parameters are not taken (empty: any car's); `provisional`: whether sets are whose peak rests on a friction prior.
  explicit Tires(std::string vehicle_hash = "", bool provisional = false)
      : vehicle_hash_(std::move(vehicle_hash)), provisional_(provisional) {}

  // The set to drive on; none before the first: the controller's own tires, with grip_mps2().
  const std::optional<Set>& set() const { return set_; }

  // Lateral acceleration to plan with.
  double grip_mps2() const {
    if (!set_) return kGravityMps2 * kCareful * kStartFriction;
    // A set is valid up to a force that was shown; NaN: not stated.
    const double front = least(set_->front.d, set_->front_valid_force_n / set_->front_load_n);
    const double rear = least(set_->rear.d, set_->rear_valid_force_n / set_->rear_load_n);
    return kGravityMps2 * left_ * std::min(front, rear);
  }

  // Takes a message of ~/pacejka; whether there is something new to plan with.
  bool take(const Set& message) {
    if (!vehicle_hash_.empty() && vehicle_hash_ != message.handshake.vehicle_hash) return false;
    if (message.status == Set::WITHDRAWN) {
      // The shape of the curves is the best there is; the grip is what the warning before it said.
      if (!set_ || left_ < 1.0) return false;
      left_ = kWithdrawn;
      return true;
    }
    if (message.status != Set::ACCEPTED && message.status != Set::ACCEPTED_WITHIN &&
        !(provisional_ && message.status == Set::PROVISIONAL)) {
      return false;
    }
    set_ = message;
    left_ = 1.0;
    return true;
  }

  // Takes a message of ~/grip; whether there is something new to plan with.
  bool feel(const Grip& message) {
    if (!set_ || message.handshake.sequence_id != set_->handshake.sequence_id || !message.fallen) return false;
    const double share = std::isfinite(message.share) ? std::clamp<double>(message.share, 0.05, 1.0) : kWithdrawn;
    if (share >= left_) return false;
    // Nothing but the next set restores it: a car that drives slower shows no grip.
    left_ = share;
    return true;
  }

 private:
  static constexpr double kGravityMps2 = 9.80665;
  static constexpr double kStartFriction = 0.51;
  // Share of the start's grip to drive with: what nobody measured is no promise.
  static constexpr double kCareful = 0.5;
  // Share of the promised grip to go on with after a set is withdrawn and no figure is known.
  static constexpr double kWithdrawn = 0.7;

  static double least(double peak, double valid) { return std::isfinite(valid) ? std::min(peak, valid) : peak; }

  std::string vehicle_hash_;
  bool provisional_;
  std::optional<Set> set_;
  double left_ = 1.0;
};
