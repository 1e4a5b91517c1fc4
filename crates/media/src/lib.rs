//! Pixels: resize, JPEG, marks drawn on a picture, H.264
