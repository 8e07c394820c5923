"""Faults planted into robots' files, one number at a time: is each caught, and named?"""
