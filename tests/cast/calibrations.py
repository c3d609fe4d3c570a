"""Calibration files as OpenCV writes them."""

#: by cv2.FileStorage of OpenCV 4
CALIBRATION = """%YAML:1.0
---
calibration_time: "Mon 03 Mar 2025 10:00:00"
image_width: 1920
image_height: 1080
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 16000., 0., 979.5, 0., 16160., 529.25, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -3.0, 80., 0.02, -0.03, -900. ]
avg_reprojection_error: 2.1e-01
"""
