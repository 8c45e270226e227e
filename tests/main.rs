//! The real command, as a user meets it. One binary; a line a module.

mod autoavatar;
mod bad_input;
mod bodies;
mod browser;
mod casas_otaduy;
mod command;
mod comparison;
mod controls;
mod doors;
mod dyna;
mod evidence;
mod exports;
mod inspect;
mod live;
mod main_job;
mod motion;
mod resume;
mod softsmpl;
mod support;
mod view;
