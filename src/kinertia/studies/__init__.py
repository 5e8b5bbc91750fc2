"""Questions asked of many synthetic people or of held-out trials: how good is the estimate?"""
