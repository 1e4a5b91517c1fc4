//! The Vlm interface and its clients
