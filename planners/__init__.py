"""The planners' room: torque planning and cooling trade studies on the same model; installed as `lptn.planners`."""
