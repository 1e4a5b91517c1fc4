//! `spf sim serve --tello` as other people's clients meet it.

mod clients;
mod ending;
mod flights;
