"""Six seconds of a camera: the lead, 30 m ahead, brakes with 4 m/s2 after three of them."""

import cv2
import numpy as np

from onboard.vision.settings import Calibration
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar

FPS = 10.0
lens = Calibration(focal_x_px=3300.0, focal_y_px=3300.0, mounting_height_m=1.3)
renderer, noise = CameraRenderer(lens), np.random.default_rng(1)
clip = cv2.VideoWriter("clip.mp4", cv2.VideoWriter.fourcc(*"mp4v"), FPS, (1280, 720))
for frame in range(60):
    braking_s = max(0.0, frame / FPS - 3.0)
    gap_m = 30.0 - 4.0 * braking_s**2 / 2
    clip.write(renderer.draw(Scene(cars=(SceneCar(gap_m, 0.0, plate="RD288HX"),)), noise))
clip.release()
