// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

#ifndef STEWART_DYNAMICS_CONTROLLER__STEWART_DYNAMICS_CONTROLLER_HPP_
#define STEWART_DYNAMICS_CONTROLLER__STEWART_DYNAMICS_CONTROLLER_HPP_

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "controller_interface/chainable_controller_interface.hpp"
#include "rclcpp/rclcpp.hpp"
#include "realtime_tools/realtime_thread_safe_box.hpp"
#include "trajectory_msgs/msg/multi_dof_joint_trajectory.hpp"

#include "stewart_dynamics_controller/feed_forward.hpp"
#include "stewart_dynamics_controller/stewart_dynamics_controller_parameters.hpp"

namespace stewart_dynamics_controller
{

/// Feed-forward of a hexapod: references of the platform or of its legs in, efforts of the legs
/// out, in the same cycle. README.md says what its interfaces mean.
class StewartDynamicsController : public controller_interface::ChainableControllerInterface
{
public:
  controller_interface::CallbackReturn on_init() override;
  controller_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State &) override;
  controller_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State &) override;
  controller_interface::CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override;
  controller_interface::InterfaceConfiguration command_interface_configuration() const override;
  controller_interface::InterfaceConfiguration state_interface_configuration() const override;

protected:
  std::vector<hardware_interface::CommandInterface::SharedPtr>
  on_export_reference_interfaces_list() override;
  std::vector<hardware_interface::StateInterface::SharedPtr>
  on_export_state_interfaces_list() override;
  controller_interface::return_type update_reference_from_subscribers(
    const rclcpp::Time & time, const rclcpp::Duration & period) override;
  controller_interface::return_type update_and_write_commands(
    const rclcpp::Time & time, const rclcpp::Duration & period) override;

private:
  using Setpoint = trajectory_msgs::msg::MultiDOFJointTrajectory;
  /// The numbers of a PlatformReference in its order.
  using PlatformNumbers = std::array<double, 19>;

  bool of_platform() const {return parameters_.reference == "platform";}
  /// Number of reference interfaces of the motion; those of wrench and effort follow.
  std::size_t motion_size() const {return of_platform() ? 19 : 18;}
  void on_parameters(const Params & parameters);
  void on_setpoint(const Setpoint & message, const std::string & base_frame);
  Six read(std::size_t first) const;
  int compute(std::int64_t now);
  /// Name of the leg that is rejected, for the log; empty if the rule is not one of a leg.
  const char * leg_text() const;
  bool write(const std::string & interface, const Six & values);
  bool write_all_but_positions(const Command & command);

  std::shared_ptr<ParamListener> parameter_listener_;
  Params parameters_;  // of on_configure: not written while the controller is active
  std::optional<FeedForward> feed_forward_;
  Command command_;  // the last one
  Six per_newton_metre_;  // per mille of the rated torques [1/(N m)]
  std::array<std::string, 6> leg_texts_;
  struct Changed
  {
    stewart_platform hexapod;
    std::optional<Governor> governor;
  };
  /// The hexapod of parameters that were set since the last cycle.
  realtime_tools::RealtimeThreadSafeBox<std::optional<Changed>> changed_;
  std::optional<imu_mounting> imu_;
  rclcpp::Subscription<Setpoint>::SharedPtr subscription_;
  /// The setpoint that the topic has brought since the last cycle.
  realtime_tools::RealtimeThreadSafeBox<std::optional<PlatformNumbers>> received_;
  std::int64_t received_at_ = -1;  // time of the cycle that took the last setpoint [ns]; none: -1
  std::int64_t deactivated_at_ = 0;  // [ns]
  bool repeated_ = false;  // no setpoint has come since the last cycle
  bool was_chained_ = false, left_chain_ = false;  // when it was activated last
  const char * last_rejection_ = nullptr;
};

}  // namespace stewart_dynamics_controller

#endif  // STEWART_DYNAMICS_CONTROLLER__STEWART_DYNAMICS_CONTROLLER_HPP_
