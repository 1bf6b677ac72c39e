"""What several runs share: the screen that shows them side by side.

drawing  who is closer and what each phase did, in words; the frames of the clouds before and after it
matches  the best match of each run: where it was taken, and its histograms
"""
