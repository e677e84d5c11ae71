"""Robots that carry the camera or the target: conversion of their models, joints and velocity
drives, forward and inverse kinematics, prediction of joint limits on a path, and workspaces.
"""
