"""PyPI's `airsim` 1.8.1, unmodified, flies the served city: argument 1 is the port. Prints a JSON object of what was seen."""

import json
import sys
import time

import airsim
import msgpackrpc
import numpy as np

port = int(sys.argv[1])
told = {}
c = airsim.MultirotorClient(port=port)
c.confirmConnection()
c.enableApiControl(True)
told["armed"] = c.armDisarm(True)
# While it is pending, the same client asks other things.
takeoff = c.takeoffAsync()
told["flying_at_once"] = c.getMultirotorState().landed_state
takeoff.join()
told["took_off"] = takeoff.get()
told["z"] = c.getMultirotorState().kinematics_estimated.position.z_val
# A box, as in the project's own example, and a path.
for vx, vy in [(1, 0), (0, 1), (-1, 0), (0, -1)]:
    c.moveByVelocityZAsync(vx, vy, -3, 2, airsim.DrivetrainType.MaxDegreeOfFreedom, airsim.YawMode(False, 0)).join()
c.moveByVelocityBodyFrameAsync(1, 0, 0, 0.3, yaw_mode=airsim.YawMode(True, 15.0)).join()
path = [airsim.Vector3r(2, 0, -4), airsim.Vector3r(2, 2, -4), airsim.Vector3r(0, 0, -4)]
way = c.moveOnPathAsync(path, 2, 120, airsim.DrivetrainType.ForwardOnly, airsim.YawMode(False, 0), 3, 1)
way.join()
told["path"] = way.get()
p = c.simGetVehiclePose().position
told["end"] = [p.x_val, p.y_val, p.z_val]
# The later motion wins.
long = c.moveToPositionAsync(0, 50, -4, 1)
short = c.hoverAsync()
short.join()
told["cancelled"], told["hovered"] = long.get(), short.get()
c.rotateToYawAsync(90).join()
told["yaw_deg"] = float(np.degrees(airsim.to_eularian_angles(c.simGetVehiclePose().orientation)[2]))

kinds = airsim.ImageType
images = c.simGetImages([
    airsim.ImageRequest("0", kinds.Scene, False, False),
    airsim.ImageRequest("0", kinds.Scene),
    airsim.ImageRequest("front_center", kinds.DepthPlanar, True),
    airsim.ImageRequest("3", kinds.Segmentation, False, False),
])
told["sizes"] = [[i.width, i.height, len(i.image_data_uint8), len(i.image_data_float)] for i in images]
told["png"] = c.simGetImage("0", kinds.Scene)[:4] == b"\x89PNG"
told["no_such_kind"] = c.simGetImage("0", kinds.OpticalFlow)
told["fov"] = c.simGetCameraInfo("0").fov
told["objects"] = len(c.simListSceneObjects())
told["relabelled"] = c.simSetSegmentationObjectID(".*crane.*", 7, True)
told["nowhere"] = bool(np.isnan(c.simGetObjectPose("nothing").position.x_val))
told["imu"] = c.getImuData().linear_acceleration.z_val
told["down"] = c.getDistanceSensorData().distance
told["gps"] = c.getGpsData().gnss.geo_point.latitude
told["pressure"] = c.getBarometerData().pressure
try:
    c.getLidarData()
except msgpackrpc.error.RPCError as error:
    told["lidar"] = str(error)

c.simPause(True)
before = c.getMultirotorState().timestamp
c.simContinueForTime(0.5)
told["continued_s"] = (c.getMultirotorState().timestamp - before) * 1e-9
told["paused"] = c.simIsPause()

# A loop as of a learner: a velocity, an interval, a state, and a picture where there is one to be seen.
steps, began = 300, time.perf_counter()
for _ in range(steps):
    c.moveByVelocityBodyFrameAsync(0.5, 0, 0, 1, yaw_mode=airsim.YawMode(True, 10))
    c.simContinueForTime(0.1)
    c.getMultirotorState()
told["steps_per_s"] = steps / (time.perf_counter() - began)
pictures, began = 30, time.perf_counter()
for _ in range(pictures):
    c.simContinueForTime(0.1)
    c.simGetImages([airsim.ImageRequest("0", kinds.Scene, False, False)])
told["pictures_per_s"] = pictures / (time.perf_counter() - began)

c.simPause(False)
c.reset()
c.enableApiControl(True)
told["reset_z"] = c.simGetVehiclePose().position.z_val
c.takeoffAsync().join()
c.landAsync().join()
told["landed"] = c.getMultirotorState().landed_state
print(json.dumps(told))
