// SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
// SPDX-License-Identifier: Apache-2.0

#include "stewart_dynamics_controller/stewart_dynamics_controller.hpp"

#include <algorithm>
#include <exception>
#include <limits>
#include <utility>

#include "pluginlib/class_list_macros.hpp"
#include "stewart_dynamics_controller/hexapod.hpp"

namespace stewart_dynamics_controller
{

using controller_interface::CallbackReturn;
using controller_interface::return_type;

namespace
{

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kPose = 7;  // numbers of a pose among the references of the platform
const char * const kState[] = {"determinant", "condition_number", "warning", "status"};

}  // namespace

CallbackReturn StewartDynamicsController::on_init()
{
  try {
    parameter_listener_ = std::make_shared<ParamListener>(get_node());
    parameters_ = parameter_listener_->get_params();
    parameter_listener_->setUserCallback(
      [this](const Params & parameters) {on_parameters(parameters);});
  } catch (const std::exception & error) {
    RCLCPP_ERROR(get_node()->get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

CallbackReturn StewartDynamicsController::on_configure(const rclcpp_lifecycle::State &)
{
  changed_.set(std::nullopt);
  parameters_ = parameter_listener_->get_params();
  // Velocities alone would drift: no position of the legs is read.
  const auto & commanded = parameters_.command_interfaces;
  if (std::all_of(commanded.begin(), commanded.end(), [](const std::string & each) {
      return each == "velocity" || each == "motor_velocity";}))
  {
    RCLCPP_ERROR(
      get_node()->get_logger(), "command_interfaces: position, effort, torque or "
      "torque_per_mille must be one of them");
    return CallbackReturn::ERROR;
  }
  try {
    per_newton_metre_ = torque_scales_of(parameters_);
    stewart_pose guess{};
    if (!of_platform()) {
      guess = initial_pose_of(parameters_);
    }
    const unsigned int rate = get_update_rate();
    const stewart_platform hexapod = hexapod_of(parameters_);
    imu_ = imu_of(parameters_);
    feed_forward_.emplace(
      hexapod, guess, static_cast<std::int64_t>(parameters_.setpoint.timeout * 1e9),
      rate > 0 ? static_cast<std::int64_t>(1e9 / rate) : 0, governor_of(parameters_, hexapod),
      imu_);
  } catch (const std::exception & error) {
    RCLCPP_ERROR(get_node()->get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  for (std::size_t n = 0; n < 6; ++n) {
    leg_texts_[n] = parameters_.joints[n] + " ";
  }
  subscription_.reset();
  if (of_platform()) {
    subscription_ = get_node()->create_subscription<Setpoint>(
      "~/setpoint/combined", rclcpp::SystemDefaultsQoS(),
      [this, frame = parameters_.base_frame](const Setpoint & message) {
        on_setpoint(message, frame);
      });
  }
  return CallbackReturn::SUCCESS;
}

CallbackReturn StewartDynamicsController::on_activate(const rclcpp_lifecycle::State &)
{
  const std::size_t not_set = of_platform() ? kPose : 6;
  for (std::size_t n = 0; n < ordered_exported_reference_interfaces_.size(); ++n) {
    (void)ordered_exported_reference_interfaces_[n]->set_value(n < not_set ? kNaN : 0.0);
  }
  received_.set(std::nullopt);
  received_at_ = -1;
  // A manager that deactivates the controller before this one alone activates this one again at
  // once, not chained.
  left_chain_ = was_chained_ && !is_in_chained_mode() &&
    !feed_forward_->timed_out(deactivated_at_, get_node()->now().nanoseconds());
  was_chained_ = is_in_chained_mode();
  last_rejection_ = nullptr;
  feed_forward_->start();
  return CallbackReturn::SUCCESS;
}

/// No force without a controller, and no drive that goes on; positions keep the last command.
CallbackReturn StewartDynamicsController::on_deactivate(const rclcpp_lifecycle::State &)
{
  deactivated_at_ = get_node()->now().nanoseconds();
  return write_all_but_positions(Command{}) ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
}

controller_interface::InterfaceConfiguration
StewartDynamicsController::command_interface_configuration() const
{
  std::vector<std::string> names;
  for (const auto & interface : parameters_.command_interfaces) {
    for (const auto & joint : parameters_.joints) {
      names.push_back(joint + "/" + interface);
    }
  }
  return {controller_interface::interface_configuration_type::INDIVIDUAL, names};
}

controller_interface::InterfaceConfiguration
StewartDynamicsController::state_interface_configuration() const
{
  if (parameters_.base.source != "imu") {
    return {controller_interface::interface_configuration_type::NONE, {}};
  }
  std::vector<std::string> names;
  for (const char * quantity : {"angular_velocity", "linear_acceleration"}) {
    for (const char axis : std::string("xyz")) {
      names.push_back(parameters_.imu_sensor + "/" + quantity + "." + axis);
    }
  }
  return {controller_interface::interface_configuration_type::INDIVIDUAL, names};
}

std::vector<hardware_interface::CommandInterface::SharedPtr>
StewartDynamicsController::on_export_reference_interfaces_list()
{
  std::vector<hardware_interface::CommandInterface::SharedPtr> references;
  const auto add = [&](const std::string & group, const std::string & interface) {
      references.push_back(
        std::make_shared<hardware_interface::CommandInterface>(
          std::string(get_node()->get_name()) + "/" + group, interface));
    };
  const auto add_axes =
    [&](const std::string & group, const std::string & quantity, const std::string & axes) {
      for (const char axis : axes) {
        add(group, quantity + "." + axis);
      }
    };
  if (of_platform()) {
    add_axes("platform", "position", "xyz");
    add_axes("platform", "orientation", "xyzw");
    for (const char * quantity : {"linear_velocity", "angular_velocity", "linear_acceleration",
        "angular_acceleration"})
    {
      add_axes("platform", quantity, "xyz");
    }
  } else {
    for (const char * quantity : {"position", "velocity", "acceleration"}) {
      for (const auto & joint : parameters_.joints) {
        add(joint, quantity);
      }
    }
  }
  add_axes("wrench", "force", "xyz");
  add_axes("wrench", "torque", "xyz");
  for (const auto & joint : parameters_.joints) {
    add(joint, "effort");
  }
  return references;
}

std::vector<hardware_interface::StateInterface::SharedPtr>
StewartDynamicsController::on_export_state_interfaces_list()
{
  std::vector<hardware_interface::StateInterface::SharedPtr> states;
  for (const char * name : kState) {
    states.push_back(
      std::make_shared<hardware_interface::StateInterface>(get_node()->get_name(), name));
  }
  return states;
}

/// In the thread that sets parameters; update_and_write_commands takes what is left in changed_.
void StewartDynamicsController::on_parameters(const Params & parameters)
{
  try {
    Changed changed{hexapod_of(parameters), std::nullopt};
    changed.governor = governor_of(parameters, changed.hexapod);
    changed_.set(std::optional<Changed>(changed));
  } catch (const std::exception & error) {
    RCLCPP_ERROR(get_node()->get_logger(), "parameters are not used: %s", error.what());
  }
}

void StewartDynamicsController::on_setpoint(
  const Setpoint & message, const std::string & base_frame)
{
  const auto & frame = message.header.frame_id;
  if (!frame.empty() && frame != base_frame) {
    RCLCPP_WARN_THROTTLE(
      get_node()->get_logger(), *get_node()->get_clock(), 1000,
      "setpoint rejected: frame_id %s, must be %s", frame.c_str(), base_frame.c_str());
    return;
  }
  if (message.points.size() != 1 || message.points[0].transforms.size() != 1 ||
    message.points[0].velocities.size() != 1 || message.points[0].accelerations.size() != 1)
  {
    RCLCPP_WARN_THROTTLE(
      get_node()->get_logger(), *get_node()->get_clock(), 1000,
      "setpoint rejected: must have one point with one transform, velocity and acceleration");
    return;
  }
  const auto & p = message.points[0].transforms[0].translation;
  const auto & q = message.points[0].transforms[0].rotation;
  const auto & v = message.points[0].velocities[0];
  const auto & a = message.points[0].accelerations[0];
  received_.set(
    PlatformNumbers{
      p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.linear.x, v.linear.y, v.linear.z, v.angular.x,
      v.angular.y, v.angular.z, a.linear.x, a.linear.y, a.linear.z, a.angular.x, a.angular.y,
      a.angular.z});
}

return_type StewartDynamicsController::update_reference_from_subscribers(
  const rclcpp::Time & time, const rclcpp::Duration &)
{
  if (left_chain_ || !of_platform()) {
    RCLCPP_ERROR(
      get_node()->get_logger(), "not chained%s: activate and deactivate this controller together "
      "with the one before it", of_platform() ? " any more" : ", with reference: legs");
    return return_type::ERROR;
  }
  std::optional<PlatformNumbers> setpoint;
  repeated_ = true;
  received_.try_set([&](auto & received) {received.swap(setpoint);});
  if (setpoint) {
    if (received_at_ >= 0 && feed_forward_->is_gap(received_at_, time.nanoseconds())) {
      feed_forward_->catch_up();
    }
    received_at_ = time.nanoseconds();
    repeated_ = false;
    for (std::size_t n = 0; n < setpoint->size(); ++n) {
      (void)ordered_exported_reference_interfaces_[n]->set_value((*setpoint)[n]);
    }
  } else if (received_at_ >= 0 && feed_forward_->timed_out(received_at_, time.nanoseconds())) {
    RCLCPP_ERROR(get_node()->get_logger(), "no setpoint for setpoint.timeout");
    return return_type::ERROR;
  }
  return return_type::OK;
}

return_type StewartDynamicsController::update_and_write_commands(
  const rclcpp::Time & time, const rclcpp::Duration &)
{
  std::optional<Changed> changed;
  changed_.try_set([&](auto & waiting) {waiting.swap(changed);});
  if (changed) {
    feed_forward_->change(changed->hexapod, changed->governor);
  }
  const int code = compute(time.nanoseconds());
  bool written = true;
  if (feed_forward_->started()) {
    written = write("position", command_.positions);
    written = write_all_but_positions(command_) && written;
  }
  const stewart_result & result = feed_forward_->result();
  const double states[] = {result.determinant, result.condition_number,
    feed_forward_->warning() ? 1.0 : 0.0, static_cast<double>(code)};
  for (std::size_t n = 0; n < std::size(states); ++n) {
    (void)ordered_exported_state_interfaces_[n]->set_value(states[n]);
  }
  const bool given = feed_forward_->started() || code != STEWART_NOT_FINITE;
  const char * rejection = given ? feed_forward_->rejection() : nullptr;
  if (rejection && rejection != last_rejection_) {
    RCLCPP_WARN(
      get_node()->get_logger(), "%s: %s%s",
      feed_forward_->started() ? "platform held, reference rejected" : "reference rejected",
      leg_text(), rejection);
  }
  last_rejection_ = rejection;
  if (feed_forward_->timed_out(time.nanoseconds())) {
    RCLCPP_ERROR(
      get_node()->get_logger(), "platform held for setpoint.timeout: %s%s", leg_text(), rejection);
    return return_type::ERROR;
  }
  return written ? return_type::OK : return_type::ERROR;
}

Six StewartDynamicsController::read(std::size_t first) const
{
  Six values;
  for (std::size_t n = 0; n < 6; ++n) {
    values[n] =
      ordered_exported_reference_interfaces_[first + n]->get_optional<double>().value_or(kNaN);
  }
  return values;
}

const char * StewartDynamicsController::leg_text() const
{
  const int leg = feed_forward_->rejected_leg();
  return leg == 0 ? "" : leg_texts_[static_cast<std::size_t>(leg - 1)].c_str();
}

int StewartDynamicsController::compute(std::int64_t now)
{
  const Six wrench = read(motion_size()), feedback = read(motion_size() + 6);
  Six reading{};
  for (std::size_t n = 0; imu_ && n < 6; ++n) {
    reading[n] = state_interfaces_[n].get_optional<double>().value_or(kNaN);
  }
  if (!of_platform()) {
    return feed_forward_->update(
      LegReference{read(0), read(6), read(12)}, wrench, feedback, now, command_, reading);
  }
  PlatformReference reference;
  auto at = ordered_exported_reference_interfaces_.begin();
  const auto take = [&](auto & numbers) {
      for (double & each : numbers) {
        each = (*at++)->template get_optional<double>().value_or(kNaN);
      }
    };
  take(reference.position);
  take(reference.orientation);
  take(reference.linear_velocity);
  take(reference.angular_velocity);
  take(reference.linear_acceleration);
  take(reference.angular_acceleration);
  const bool repeated = repeated_ && !is_in_chained_mode();
  return feed_forward_->update(reference, wrench, feedback, now, command_, reading, repeated);
}

bool StewartDynamicsController::write_all_but_positions(const Command & command)
{
  Six per_mille;
  for (std::size_t n = 0; n < 6; ++n) {
    per_mille[n] = command.torques[n] * per_newton_metre_[n];
  }
  bool written = write("velocity", command.velocities);
  written = write("effort", command.efforts) && written;
  written = write("torque", command.torques) && written;
  written = write("torque_per_mille", per_mille) && written;
  return write("motor_velocity", command.motor_velocities) && written;
}

/// Write the values of an interface, if it is commanded.
bool StewartDynamicsController::write(const std::string & interface, const Six & values)
{
  bool written = true;
  for (std::size_t group = 0; group < parameters_.command_interfaces.size(); ++group) {
    for (std::size_t n = 0; parameters_.command_interfaces[group] == interface && n < 6; ++n) {
      written = command_interfaces_[6 * group + n].set_value(values[n]) && written;
    }
  }
  return written;
}

}  // namespace stewart_dynamics_controller

PLUGINLIB_EXPORT_CLASS(
  stewart_dynamics_controller::StewartDynamicsController,
  controller_interface::ChainableControllerInterface)
