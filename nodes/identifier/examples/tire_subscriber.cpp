// A node that says what an MPC would plan with. In a package that depends on rclcpp and gripsight_msgs:
//   add_executable(tire_subscriber tire_subscriber.cpp)
//   ament_target_dependencies(tire_subscriber rclcpp gripsight_msgs)
#include <memory>
#include <string>

#include <rclcpp/rclcpp.hpp>

#include "tires.hpp"

class TireSubscriber : public rclcpp::Node {
 public:
  TireSubscriber()
      : Node("tire_subscriber"),
        tires_(declare_parameter<std::string>("vehicle_hash", ""), declare_parameter<bool>("take_provisional", false)) {
    // Who comes late gets the last message, too.
    const auto latched = rclcpp::QoS(1).reliable().transient_local();
    sets_ = create_subscription<Tires::Set>("/identifier/pacejka", latched, [this](const Tires::Set& message) { plan(tires_.take(message)); });
    grips_ = create_subscription<Tires::Grip>("/identifier/grip", latched, [this](const Tires::Grip& message) { plan(tires_.feel(message)); });
    plan(true);
  }

 private:
  // Here a controller takes tires_.set(), and plans its speeds anew.
  void plan(bool is_new) {
    if (is_new) RCLCPP_INFO(get_logger(), "plan with %.2f m/s2", tires_.grip_mps2());
  }

  Tires tires_;
  rclcpp::Subscription<Tires::Set>::SharedPtr sets_;
  rclcpp::Subscription<Tires::Grip>::SharedPtr grips_;
};

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<TireSubscriber>());
  rclcpp::shutdown();
  return 0;
}
